//! Numbers of labels and their names.

use ground::builder;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Numbers and names of one label column, sorted by number.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct NameTable {
    /// Rising, each once; never 0.
    #[doc(hidden)]
    pub ids: Vec<u32>,
    /// One for each number.
    #[doc(hidden)]
    pub names: Vec<String>,
}

impl<S: AsRef<str>> FromIterator<(u32, S)> for NameTable {
    /// A table of these numbers and names, in any order; of equal numbers the last one counts, 0 has no name.
    fn from_iter<I: IntoIterator<Item = (u32, S)>>(rows: I) -> Self {
        let mut table = NameTable::default();
        rows.into_iter().for_each(|(id, name)| table.set(id, name.as_ref()));
        table
    }
}

impl NameTable {
    /// Numbers `names` in sorted order from 1, keeping the numbers that `fixed` gives.
    ///
    /// Names without a fixed number take the free numbers in sorted order. An empty name gets none.
    pub fn number(names: impl IntoIterator<Item = String>, fixed: &BTreeMap<String, u32>) -> Self {
        let names: BTreeSet<String> = names.into_iter().filter(|name| !name.is_empty()).collect();
        let taken: BTreeSet<u32> = fixed.values().copied().collect();
        let mut free = (1u32..).filter(|id| !taken.contains(id));
        let mut rows: Vec<(u32, String)> = names
            .into_iter()
            .map(|name| (fixed.get(&name).copied().unwrap_or_else(|| free.next().unwrap_or(0)), name))
            .filter(|(id, _)| *id != 0)
            .collect();
        rows.sort();
        let (ids, names) = rows.into_iter().unzip();
        NameTable { ids, names }
    }

    /// Names the number `id`, replacing any earlier name; 0 has none.
    pub fn set(&mut self, id: u32, name: &str) {
        match self.ids.binary_search(&id) {
            _ if id == 0 => {}
            Ok(row) => name.clone_into(&mut self.names[row]),
            Err(row) => {
                self.ids.insert(row, id);
                self.names.insert(row, name.to_owned());
            }
        }
    }

    /// Removes the number `id`.
    #[doc(hidden)]
    pub fn remove(&mut self, id: u32) {
        if let Ok(row) = self.ids.binary_search(&id) {
            self.ids.remove(row);
            self.names.remove(row);
        }
    }

    /// Adopts the names of `other`: known ones keep their number here, the others theirs if it is free. Returns a map
    /// from the numbers of `other` that differ here to those here.
    #[doc(hidden)]
    pub fn absorb(&mut self, other: &NameTable) -> HashMap<u32, u32> {
        let known: HashMap<String, u32> = self.iter().map(|(id, name)| (name.to_owned(), id)).collect();
        let mut changed = HashMap::new();
        for (id, name) in other.iter() {
            let here = known.get(name).copied().unwrap_or_else(|| {
                let id = self.free(id);
                self.set(id, name);
                id
            });
            if here != id {
                changed.insert(id, here);
            }
        }
        changed
    }

    /// The number of `name`, a new one if it has none.
    #[doc(hidden)]
    pub fn numbered(&mut self, name: &str) -> u32 {
        match self.id(name) {
            0 if !name.is_empty() => {
                let id = self.free(self.ids.len() as u32 + 1);
                self.set(id, name);
                id
            }
            known => known,
        }
    }

    /// A free number: `preferred`, else the one after the last.
    #[doc(hidden)]
    pub fn free(&self, preferred: u32) -> u32 {
        let is_free = |id: &u32| self.ids.binary_search(id).is_err();
        if is_free(&preferred) {
            return preferred;
        }
        let next = self.ids.last().and_then(|last| last.checked_add(1));
        next.or_else(|| (1..).find(is_free)).unwrap_or(preferred)
    }

    /// The numbers, rising, each once; never 0 (which means unlabelled).
    pub fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The names, one for each number.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of `name`; 0 when it has none.
    pub fn id(&self, name: &str) -> u32 {
        self.names.iter().position(|n| n == name).map_or(0, |row| self.ids[row])
    }

    /// Names to numbers.
    #[doc(hidden)]
    pub fn to_map(&self) -> HashMap<&str, u32> {
        self.iter().map(|(id, name)| (name, id)).collect()
    }

    /// Name of number `id`.
    pub fn name(&self, id: u32) -> Option<&str> {
        self.ids.binary_search(&id).ok().map(|row| self.names[row].as_str())
    }

    /// `(number, name)` pairs, rising.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &str)> {
        self.ids.iter().copied().zip(self.names.iter().map(String::as_str))
    }
}

builder! {
    /// The name tables of a scene; they accompany every output.
    #[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
    pub struct Labels {
        /// Names of `category_id`.
        pub category: NameTable,
        /// Names of `part_id`.
        pub part: NameTable,
        /// Names of `material_id`.
        pub material: NameTable,
        /// Names of `instance_id`: the objects. Names may repeat here, numbers do not.
        pub instance: NameTable,
        /// ASPRS class, as in LAS, of a `category_id`; that of others is 0, never classified.
        #[serde(skip)]
        pub las_class: BTreeMap<u32, u8>,
    }
}

impl Labels {
    /// The four tables with the stems of their column names: `category`, `part`, `material`, `instance`.
    pub fn tables(&self) -> [(&'static str, &NameTable); 4] {
        [("category", &self.category), ("part", &self.part), ("material", &self.material), ("instance", &self.instance)]
    }
}
