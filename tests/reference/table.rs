//! Tables of expected values: CSV with a header; lines that start with `#` say where they come from.

use std::collections::HashMap;

/// A table of text.
pub struct Table {
    columns: HashMap<String, usize>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Reads CSV with `separator`.
    ///
    /// # Panics
    /// On rows of unequal length, and without a header.
    pub fn parse(text: &str, separator: char) -> Table {
        let mut lines = text
            .lines()
            .filter(|line| !line.starts_with('#') && !line.trim().is_empty())
            .map(|line| line.split(separator).map(|cell| cell.trim().to_owned()).collect::<Vec<_>>());
        let header = lines.next().expect("a header");
        let rows: Vec<_> = lines.collect();
        assert!(rows.iter().all(|row| row.len() == header.len()), "rows as long as the header {header:?}");
        Table { columns: header.into_iter().enumerate().map(|(index, name)| (name, index)).collect(), rows }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Cell of row `row` in the column called `column`.
    pub fn text(&self, row: usize, column: &str) -> &str {
        &self.rows[row][self.columns[column]]
    }

    /// [`Table::text`] as a number.
    ///
    /// # Panics
    /// When it is none.
    pub fn number(&self, row: usize, column: &str) -> f64 {
        let text = self.text(row, column);
        text.parse().unwrap_or_else(|_| panic!("{column} of row {row} is {text:?}"))
    }
}
