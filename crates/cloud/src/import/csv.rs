//! Text: rows of numbers below a header of column names, or without one.
//!
//! What programs write: CloudCompare a header after `//` and, as an option, the number of points below it; Leica's
//! Cyclone (PTS) and FARO's SCENE the number of points above rows without a header, PTS again for each scan;
//! spreadsheets quotes, semicolons and decimal commas.

use super::Source;
use super::about::About;
use super::names::{self, NamedColumn};
use super::rows::Rows;
use super::target;
use super::text::{self, TextLines, TextStyle, WordTarget, is_comment};
use crate::{Field, PointCloud};
use ground::error::{Error, Result};
use ground::read::number::Number;
use ground::report::Report;
use ground::shown;
use std::io::Read as _;

/// Maximum number of columns.
const COLUMNS: usize = 4096;
/// Maximum number of lines before the points.
const BEFORE: usize = 1000;
/// Numbers of the first rows that are read to guess the meaning of the columns.
const SAMPLE: usize = 20_000;
/// Number of lines that are compared to find how rows are divided.
const ALIKE: usize = 100;
/// Byte order marks of 16-bit text.
const WIDE: [&[u8]; 2] = [b"\xff\xfe", b"\xfe\xff"];
/// Name of columns that are left out.
const NOTHING: &str = "_";
/// Maximum number of bytes before the points that are read, not counting comments.
const HEAD: usize = 4 << 20;

/// Whether a file that begins with `bytes` is in this format: its first line names columns or consists of numbers, or
/// there are such lines below a title.
pub(super) fn begins(bytes: &[u8]) -> bool {
    if WIDE.iter().any(|wide| bytes.starts_with(wide)) {
        return true;
    }
    let text = String::from_utf8_lossy(bytes);
    if text.contains('\0') {
        return false;
    }
    let mut titles = 0;
    let mut header: Option<&str> = None;
    for line in text.trim_start_matches('\u{feff}').lines().map(str::trim).filter(|line| !line.is_empty()) {
        let ours = || {
            let mut signs = styles(line).filter(|style| style.sign.is_some());
            signs.any(|style| named(line, style).iter().any(|column| names::own(column).is_some()))
        };
        let is_row_of_header = || header.is_some_and(|header| pair(header, line, &[]).is_some());
        if is_comment(line) {
            if has_places(bare(line)) {
                return true;
            }
        } else if is_count(line) {
            // Another line decides what it counts.
        } else if titles == 0 && (is_row(line) || has_places(line) || ours()) || is_row_of_header() {
            return true;
        } else {
            titles += 1;
            header = Some(line).filter(|line| has_places(line)).or(header);
        }
    }
    false
}

/// Whether `line` is a number of rows.
fn is_count(line: &str) -> bool {
    line.parse::<u64>().is_ok()
}

/// Ways to divide `line` into words, the likeliest first.
fn styles(line: &str) -> impl Iterator<Item = TextStyle> {
    let signs = [';', '\t', ','].into_iter().filter(|&sign| line.contains(sign));
    let style = |sign: Option<char>| TextStyle { sign, decimal_comma: sign != Some(','), ..TextStyle::default() };
    signs.map(Some).chain([None]).map(style)
}

/// The number in each word of `line`, if it is one.
fn numbers(line: &str, style: TextStyle) -> impl Iterator<Item = Option<f64>> {
    style.words(line).take(style.count(line)).map(move |word| style.number(word))
}

/// The number of words of `line` before the first three consecutive numbers; `None`: there are none.
fn words_before(line: &str, style: TextStyle) -> Option<usize> {
    let mut row = 0;
    let third = style.words(line).position(|word| {
        row = if !word.is_empty() && style.number(word).is_some() { row + 1 } else { 0 };
        row == 3
    })?;
    Some(third - 2)
}

/// Whether `line` is the row of a point, regardless of its columns.
fn is_row(line: &str) -> bool {
    styles(line).any(|style| words_before(line, style) == Some(0))
}

/// A comment without its markers.
fn bare(comment: &str) -> &str {
    comment.trim_start_matches(['#', '/', '%']).trim()
}

/// The field of `column`, if it has one.
fn field(column: &NamedColumn) -> Option<Field> {
    names::own(column).or_else(|| names::foreign(column)).map(|goal| goal.field)
}

/// Whether `header` names all coordinates.
fn has_places(header: &str) -> bool {
    styles(header).any(|style| {
        let columns = named(header, style);
        [Field::X, Field::Y, Field::Z].iter().all(|axis| columns.iter().any(|column| field(column) == Some(*axis)))
    })
}

/// The columns that `header` names.
fn named(header: &str, style: TextStyle) -> Vec<NamedColumn> {
    let mut columns: Vec<NamedColumn> = Vec::new();
    for word in style.words(header).take(style.count(header)) {
        let brackets = style.sign.is_none() && word.starts_with(['(', '[']) && word.ends_with([')', ']']);
        match columns.last_mut().filter(|_| brackets) {
            // X [m] Y [m] Z [m]
            Some(last) => last.name = format!("{} {word}", last.name),
            None => columns.push(as_they_are(word)),
        }
    }
    columns
}

/// A column of this name, with the type whose numbers are not scaled.
fn as_they_are(name: &str) -> NamedColumn {
    NamedColumn::new(name, Number::U8)
}

/// The columns of `row` as named by `header`, and how the row is divided, like most of the lines `behind` it; `None`:
/// it is not a header of that row.
fn pair(header: &str, row: &str, behind: &[CsvLine]) -> Option<(Vec<NamedColumn>, TextStyle)> {
    let fits = |columns: &[NamedColumn], line: &str, style: TextStyle| {
        // The last word may be empty.
        let counts = [style.count(line), style.words(line).count()];
        let (mut filled, mut fits) = (false, counts.contains(&columns.len()));
        let known = columns.iter().zip(style.words(line)).filter(|(column, _)| field(column).is_some());
        for word in known.map(|(_, word)| word) {
            filled |= !word.is_empty();
            fits &= style.number(word).is_some();
        }
        filled && fits
    };
    let fitting = styles(header).filter_map(|of_header| {
        let columns = named(header, of_header);
        let known = columns.iter().filter(|column| field(column).is_some()).count();
        let more = |style| behind.iter().take(ALIKE).filter(|line| fits(&columns, &line.text, style)).count();
        let all = styles(row).filter(|&style| fits(&columns, row, style)).map(|style| (more(style), style));
        let (more, style) = first_of_most(all)?;
        Some(([known, more], (columns, style)))
    });
    first_of_most(fitting).map(|(_, found)| found)
}

/// How the first of `lines`, a row without a header, is divided, like most of those after it; `None`: it is not a row.
/// If it begins with words, the next line must have the same form.
fn alone(lines: &[CsvLine]) -> Option<TextStyle> {
    let row = &lines.first()?.text;
    let same = |style: TextStyle| {
        let shape = |line: &str| (words_before(line, style), style.count(line));
        let requested = shape(row);
        let more = lines[1..].iter().filter(|line| !is_count(&line.text)).take(ALIKE);
        let alike = more.clone().filter(|line| shape(&line.text) == requested).count();
        let next = more.clone().next().is_none_or(|line| shape(&line.text) == requested);
        requested.0.filter(|&before| before == 0 || next).map(|_| (alike, style))
    };
    first_of_most(styles(row).filter_map(same)).map(|(_, style)| style)
}

/// The first element with the largest number.
fn first_of_most<N: PartialOrd, T>(all: impl Iterator<Item = (N, T)>) -> Option<(N, T)> {
    all.reduce(|best, other| if other.0 > best.0 { other } else { best })
}

/// A line that is neither empty nor a comment.
struct CsvLine {
    text: String,
    /// The byte where it begins, and the number of lines before it.
    at: u64,
    before: u64,
}

/// The first lines of a file.
struct Head {
    lines: Vec<CsvLine>,
    /// Comments that name columns, with the index of the line that follows; only the last before a line.
    comments: Vec<(usize, String)>,
    /// The end, if the file has no more lines.
    end: Option<(u64, u64)>,
}

impl Head {
    fn of(source: &Source) -> Result<Head> {
        let mut head = Head { lines: Vec::new(), comments: Vec::new(), end: None };
        let (mut lines, mut bytes) = (TextLines::of(source)?, 0);
        while head.lines.len() < BEFORE + ALIKE && bytes < HEAD {
            let (at, before) = (lines.at(), lines.number());
            let Some(line) = lines.next()? else {
                head.end = Some((at, before));
                break;
            };
            if line.is_empty() {
                continue;
            }
            if is_comment(line) {
                if has_places(bare(line)) {
                    head.comments.retain(|(place, _)| *place != head.lines.len());
                    head.comments.push((head.lines.len(), bare(line).to_owned()));
                }
                continue;
            }
            bytes += line.len();
            head.lines.push(CsvLine { text: line.to_owned(), at, before });
        }
        Ok(head)
    }

    /// Lines that may name the columns of the row `row`, the likeliest first.
    fn headers(&self, row: usize) -> impl Iterator<Item = &str> {
        let texts = || self.lines[..row].iter().rev().map(|line| &*line.text).filter(|line| !is_count(line));
        let comment = self.comments.iter().rfind(|(place, _)| *place <= row).map(|(_, comment)| &**comment);
        let known = |line: &&str| {
            !has_places(line) && {
                styles(line).any(|style| named(line, style).iter().any(|column| field(column).is_some()))
            }
        };
        texts().filter(|line| has_places(line)).chain(comment).chain(texts().filter(known))
    }

    /// The `columns` with the units that a line between header and row gives.
    fn with_units(&self, row: usize, columns: Vec<NamedColumn>) -> Vec<NamedColumn> {
        // As many words as columns, at least one of them a unit and none a name.
        let fits = |words: &Vec<&str>| words.len() == columns.len() && words.iter().any(|word| names::is_unit(word));
        let odd = |words: &Vec<&str>| words.iter().any(|word| as_field(word).is_some() && !names::is_unit(word));
        let texts = self.lines[..row].iter().rev().take(2).map(|line| &*line.text);
        let mut divided = texts.flat_map(|text| {
            styles(text).map(move |style| style.words(text).take(style.count(text)).collect::<Vec<_>>())
        });
        let Some(units) = divided.find(|words| fits(words) && !odd(words)) else { return columns };
        columns.iter().zip(units).map(|(column, unit)| as_they_are(&names::with_unit(&column.name, unit))).collect()
    }
}

/// The field called `name`, if there is one.
fn as_field(name: &str) -> Option<Field> {
    field(&as_they_are(name))
}

/// The layout of a file, from what precedes the points.
struct CsvLayout {
    columns: Vec<NamedColumn>,
    style: TextStyle,
    /// The byte where the points begin, and the number of lines before them.
    at: u64,
    before: u64,
    /// Whether there is no header that names the columns.
    bare: bool,
    /// Whether numbers have decimal commas.
    commas: bool,
}

impl CsvLayout {
    fn of(source: &Source) -> Result<CsvLayout> {
        let head = Head::of(source)?;
        let requested = source.columns;
        // The line that counts the rows below it.
        let mut counted: Option<usize> = None;
        for (row, line) in head.lines.iter().enumerate().take(BEFORE) {
            let found = match requested {
                Some(requested) => {
                    with_requested(&head.lines[row..], requested).map(|(columns, style)| (columns, style, false))
                }
                None => below(&head, row),
            };
            let counts = is_count(&line.text);
            let Some((columns, mut style, bare)) = found else {
                counted = if counts { counted.or(Some(row)) } else { None };
                continue;
            };
            if columns.len() > COLUMNS {
                return Err(source.error(format!("has {} columns; allowed: {COLUMNS}", columns.len())));
            }
            style.counts = counted.is_some();
            let rows = head.lines[row..].iter().take(ALIKE);
            let mut words = rows.flat_map(|line| style.words(&line.text).map(move |word| (style, word)));
            let commas = words.any(|(style, word)| word.contains(',') && style.number(word).is_some());
            let CsvLine { at, before, .. } = &head.lines[counted.unwrap_or(row)];
            return Ok(CsvLayout { columns, style, at: *at, before: *before, bare, commas });
        }
        if let (Some(end), None) = (head.end, requested) {
            // No points at all, or none that is complete, which is reported when they are read.
            if let Some(header) = head.headers(head.lines.len()).find(|header| is_header(header)) {
                let (style, columns) = divided(header);
                let behind = head.lines.iter().rposition(|line| line.text == header).map_or(0, |header| header + 1);
                let row = head.lines[behind..].iter().find(|line| !is_count(&line.text));
                let (at, before) = row.map_or(end, |row| (row.at, row.before));
                return Ok(CsvLayout { columns, style, at, before, bare: false, commas: false });
            }
        }
        Err(source.error(match requested {
            Some(requested) => {
                format!("has no row for the columns {} in its first {BEFORE} lines", requested.join(","))
            }
            None => {
                format!("has no rows of points in its first {BEFORE} lines; expected numbers below a header, or alone")
            }
        }))
    }

    /// The lines of the points.
    fn lines<'a>(&self, source: &'a Source<'a>) -> Result<TextLines<'a>> {
        TextLines::behind(source, self.at, self.before)
    }

    /// The numbers of the first rows; `None` for words.
    fn sample(&self, source: &Source) -> Result<Vec<Vec<Option<f64>>>> {
        let mut lines = self.lines(source)?;
        let mut rows = Vec::new();
        while rows.len() < (SAMPLE / self.columns.len().max(1)).max(1) {
            let Some(line) = lines.next()? else { break };
            let row: Vec<Option<f64>> = numbers(line, self.style).collect();
            if row.len() == self.columns.len() && !is_comment(line) {
                rows.push(row);
            }
        }
        Ok(rows)
    }
}

/// Whether `header` names a column.
fn is_header(header: &str) -> bool {
    styles(header).any(|style| named(header, style).iter().any(|column| field(column).is_some()))
}

/// How `header` is divided if there is no row: such that it names the most columns.
fn divided(header: &str) -> (TextStyle, Vec<NamedColumn>) {
    let all = styles(header).map(|style| (style, named(header, style)));
    let known = |columns: &[NamedColumn]| columns.iter().filter(|column| field(column).is_some()).count();
    let best = all.reduce(|best, other| if known(&other.1) > known(&best.1) { other } else { best });
    best.unwrap_or_default()
}

/// The requested columns of the first of `lines`, and how it is divided; `None`: it does not have a number for each.
fn with_requested(lines: &[CsvLine], requested: &[String]) -> Option<(Vec<NamedColumn>, TextStyle)> {
    let fits = |line: &str, style: TextStyle| {
        let mut words = style.words(line);
        requested.iter().all(|column| {
            words.next().is_some_and(|word| column == NOTHING || !word.is_empty() && style.number(word).is_some())
        })
    };
    let row = &lines.first()?.text;
    if is_count(row) && requested.len() > 1 {
        return None;
    }
    let alike = |style: TextStyle| lines.iter().take(ALIKE).filter(|line| fits(&line.text, style)).count();
    let (alike, style) =
        first_of_most(styles(row).filter(|&style| fits(row, style)).map(|style| (alike(style), style)))?;
    // A title with a number in it.
    let words = numbers(row, style).any(|number| number.is_none());
    if words && alike < 2 && lines.len() > 1 {
        return None;
    }
    let nothing = std::iter::repeat_n(NOTHING, style.count(row).saturating_sub(requested.len()));
    Some((requested.iter().map(String::as_str).chain(nothing).map(as_they_are).collect(), style))
}

/// The columns of the line `row`, how it is divided, and whether there is no header that names them; `None`: it is not
/// a row.
fn below(head: &Head, row: usize) -> Option<(Vec<NamedColumn>, TextStyle, bool)> {
    let lines = &head.lines[row..];
    let line = &*lines.first()?.text;
    if let Some((columns, style)) = head.headers(row).find_map(|header| pair(header, line, &lines[1..])) {
        return Some((head.with_units(row, columns), style, false));
    }
    if is_count(line) {
        return None;
    }
    let style = alone(lines)?;
    // Numbers below names, but of another count, or other words: the line is reported when it is read.
    let texts = head.lines[..row].iter().rev().map(|line| &*line.text);
    if let Some(header) = texts.filter(|_| words_before(line, style) == Some(0)).find(|header| has_places(header)) {
        let (_, columns) = divided(header);
        return Some((head.with_units(row, columns), style, false));
    }
    // As many words directly above, each without a blank, are names of unknown columns.
    let above = row.checked_sub(1).map(|above| &*head.lines[above].text).filter(|_| style.sign.is_some());
    let names = above.map(|above| named(above, style)).unwrap_or_default();
    let is_name =
        |column: &NamedColumn| !column.name.contains(char::is_whitespace) && style.number(&column.name).is_none();
    if names.len() > 1 && names.len() == style.count(line) && names.iter().all(is_name) {
        return Some((names, style, false));
    }
    Some(((0..style.count(line)).map(|_| as_they_are(NOTHING)).collect(), style, true))
}

/// The likely meaning of the columns of rows without a header: for three to nine columns of numbers, every combination
/// that programs write.
fn guess(sample: &[Vec<Option<f64>>], columns: usize) -> Vec<&'static str> {
    const COLOUR: [&str; 3] = ["red", "green", "blue"];
    const NORMAL: [&str; 3] = ["normal_x", "normal_y", "normal_z"];
    // Names of points and the like are left out.
    let places: Vec<usize> = (0..columns).filter(|&at| sample.iter().all(|row| row[at].is_some())).collect();
    let sample: Vec<Vec<f64>> =
        sample.iter().map(|row| places.iter().map(|&at| row[at].unwrap_or(f64::NAN)).collect()).collect();
    let colours = |from: usize| {
        let values = || sample.iter().filter_map(move |row| row.get(from..from + 3)).flatten().filter(|v| !v.is_nan());
        let whole = values().all(|value| value.fract() == 0.0 && (0.0..=65535.0).contains(value));
        whole || values().all(|value| (0.0..=1.0).contains(value))
    };
    let normals = |from: usize| {
        let normals = sample.iter().filter_map(|row| row.get(from..from + 3));
        let squares = normals.map(|normal| normal.iter().map(|value| value * value).sum::<f64>());
        let mut squares = squares.filter(|square| !square.is_nan());
        let unit = |square: f64| (square - 1.0).abs() < 0.05;
        squares.clone().any(unit) && squares.all(|square| square == 0.0 || unit(square))
    };
    let more: Vec<&str> = match places.len() {
        4 => vec!["intensity"],
        6 if normals(3) => NORMAL.into(),
        6 if colours(3) => COLOUR.into(),
        7 if colours(4) => [&["intensity"], &COLOUR[..]].concat(),
        7 if colours(3) => [&COLOUR[..], &["intensity"]].concat(),
        9 if colours(3) && normals(6) => [COLOUR, NORMAL].concat(),
        _ => Vec::new(),
    };
    let mut names = vec![NOTHING; columns];
    places.into_iter().zip(["x", "y", "z"].into_iter().chain(more)).for_each(|(place, name)| names[place] = name);
    names
}

/// Checks the names of `columns` given by a user.
///
/// # Errors
/// The first unknown name.
pub(super) fn check(columns: &[String]) -> Result<()> {
    let known = |name: &String| {
        let column = as_they_are(name);
        name == NOTHING || names::own(&column).or_else(|| names::foreign(&column)).is_some()
    };
    // The error lists all names.
    columns.iter().find(|name| !known(name)).map_or(Ok(()), |name| Field::from_name(name).map(drop))
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let mut beginning = [0; 2];
    let read = source.from(0)?.read(&mut beginning).map_err(|error| Error::io(source.path, error))?;
    if WIDE.contains(&&beginning[..read]) {
        return Err(source.error("is text of 16 bits (UTF-16); allowed: UTF-8"));
    }
    if is_ptx(source)? {
        return Err(source.error("is a PTX file, of grids with matrices; allowed: XYZ and PTS, or E57"));
    }
    let mut layout = CsvLayout::of(source)?;
    if layout.bare {
        let names = guess(&layout.sample(source)?, layout.columns.len());
        let listed = names.iter().filter(|&&name| name != NOTHING).copied().collect::<Vec<_>>().join(",");
        let left = match names.iter().filter(|&&name| name == NOTHING).count() {
            0 => String::new(),
            count => format!(", and {count} more are left out"),
        };
        report.warn(format!(
            "csv: no header names its columns, which are taken as {listed}{left}; --columns overrides that"
        ));
        layout.columns = names.into_iter().map(as_they_are).collect();
    }
    if layout.commas {
        report.warn("csv: commas in its numbers are taken as decimal points");
    }
    let columns = &layout.columns;
    let about = About::beside(source.path)?;
    // Integers have their own unit of time in other formats; here all are seconds.
    let goals = names::goals(columns, "csv", report);
    let listed = about.as_ref().and_then(|about| about.columns.as_deref()).unwrap_or_default();
    let listed = listed.iter().filter(|_| source.columns.is_none());
    if let Some(missing) = listed.into_iter().find(|name| !columns.iter().any(|column| column.name == **name)) {
        let missing = shown::name(missing);
        return Err(source.error(format!("has no column {missing}, which its label names list: it is cut off")));
    }
    let mut rows = Rows::new(target::fields(&goals), 0, about.as_ref())?.with_any_colours();
    let places: Vec<Option<WordTarget>> = goals.into_iter().map(|goal| goal.map(WordTarget::Goal)).collect();
    text::read(layout.lines(source)?, layout.style, &places, None, &mut rows)?;
    rows.finish(source.path, "csv", about.unwrap_or_default(), report)
}

/// Whether numbers of rows and columns, positions and matrices precede the points, as in PTX files.
fn is_ptx(source: &Source) -> Result<bool> {
    let mut lines = TextLines::of(source)?;
    for words in [1, 1, 3, 3, 3, 3, 4, 4, 4, 4] {
        if lines.next()?.is_none_or(|line| line.split_whitespace().count() != words) {
            return Ok(false);
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_known_by_their_first_lines() {
        for text in [
            "x,y,z\n1,2,3\n",
            "\u{feff}X,Y,Z,Intensity\r\n",
            "\"X\";\"Y\";\"Z\"\n",
            "//X Y Z R G B\n2\n",
            "# made on Monday\n# x y z\n",
            "X(m),Y(m),Z(m)\n",
            "range,category_id\n",
            "2\n1 2 3 4\n",
            "\n1.5 2.5 3.5\n",
            "1,5;2,5;3,5\n",
            "Survey of Monday\nX Y Z\n1 2 3\n",
            "a title\nand more\nName;X;Y;Z\nm;m;m;m\nP1;1;2;3\n",
        ] {
            assert!(begins(text.as_bytes()), "{text:?}");
        }
        for text in
            ["", "# nothing", "solid cube\n", "v 1 2 3\n", "name: a\n", "1 2\n3 4\n", "To whom it may concern, t\n"]
        {
            assert!(!begins(text.as_bytes()), "{text:?}");
        }
        assert!(begins(b"\xff\xfex\0,\0") && !begins(b"x\0,\0y\0"));
    }

    #[test]
    fn columns_without_a_header_are_guessed_by_their_numbers() {
        let guessed = |row: &[f64]| guess(&[row.iter().copied().map(Some).collect()], row.len()).join(",");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, -2048.0]), "x,y,z,intensity");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 9.0, 255.0, 0.0]), "x,y,z,red,green,blue");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 0.6, -0.8, 0.0]), "x,y,z,normal_x,normal_y,normal_z");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, -5.0, 255.0, 0.0, 9.0]), "x,y,z,intensity,red,green,blue");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 255.0, 0.0, 9.0, -0.5]), "x,y,z,red,green,blue,intensity");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 255.0, 0.0]), "x,y,z,_,_");
    }
}
