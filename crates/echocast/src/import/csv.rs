//! Text: rows of numbers behind a header of column names, or without one.
//!
//! What programs write: CloudCompare a header behind `//` and, if asked to, the number of points below it; Leica's
//! Cyclone (PTS) and FARO's SCENE the number of points above rows without a header, PTS again for each scan; spreadsheets
//! quotes, semicolons and decimal commas.

use super::Source;
use super::about::About;
use super::names::{self, Named};
use super::rows::{self, Goal, Rows};
use super::text::{self, Lines, Place, Style, is_comment};
use crate::cloud::{Field, PointCloud};
use crate::ground::error::{Error, Result};
use crate::ground::report::Report;
use crate::ground::shown;
use crate::read::number::Number;
use std::io::Read as _;

/// Most columns.
const COLUMNS: usize = 4096;
/// Most lines before the points.
const BEFORE: usize = 1000;
/// How many numbers of the first rows are read to guess what the columns are.
const SAMPLE: usize = 20_000;
/// How texts of 16 bits begin.
const WIDE: [&[u8]; 2] = [b"\xff\xfe", b"\xfe\xff"];
/// What a column is called that goes nowhere.
const NOTHING: &str = "_";

/// Whether a file that begins with `bytes` is one: its first line names columns, or is of numbers.
pub(super) fn begins(bytes: &[u8]) -> bool {
    if WIDE.iter().any(|wide| bytes.starts_with(wide)) {
        return true;
    }
    let text = String::from_utf8_lossy(bytes);
    if text.contains('\0') {
        return false;
    }
    for line in text.trim_start_matches('\u{feff}').lines().map(str::trim) {
        let ours = || named(line).iter().any(|column| names::own(column).is_some());
        match line {
            "" => {}
            comment if is_comment(comment) => {
                if has_places(bare(comment)) {
                    return true;
                }
            }
            count if is_count(count) => {}
            header => return is_row(header) || has_places(header) || header_style(header).sign.is_some() && ours(),
        }
    }
    false
}

/// Whether `line` is a number of rows.
fn is_count(line: &str) -> bool {
    line.parse::<u64>().is_ok()
}

/// Whether `line` is the row of a point, whatever its columns are.
fn is_row(line: &str) -> bool {
    let style = row_style(line);
    let numbers = style.words(line).take(3).filter(|word| !word.is_empty() && style.number(word).is_some());
    numbers.count() == 3
}

/// A comment without its signs.
fn bare(comment: &str) -> &str {
    comment.trim_start_matches(['#', '/']).trim()
}

/// Whether `header` names all coordinates.
fn has_places(header: &str) -> bool {
    let columns = named(header);
    let find = |column: &Named| names::own(column).or_else(|| names::foreign(column)).map(|goal| goal.field);
    [Field::X, Field::Y, Field::Z].iter().all(|axis| columns.iter().any(|column| find(column) == Some(*axis)))
}

/// The columns that `header` names.
fn named(header: &str) -> Vec<Named> {
    let mut columns: Vec<Named> = header_style(header).words(header).map(as_they_are).collect();
    // A separator behind the last name is none.
    columns.pop_if(|last| last.name.is_empty());
    columns
}

/// A column of this name. Of the types of numbers, that whose numbers are meant as they are.
fn as_they_are(name: &str) -> Named {
    Named::new(name, Number::U8)
}

fn header_style(header: &str) -> Style {
    Style { sign: [';', '\t', ','].into_iter().find(|&sign| header.contains(sign)), ..Style::default() }
}

fn row_style(row: &str) -> Style {
    let blanks = Style { decimal_comma: true, ..Style::default() };
    // 1,5 2,5 3,5: between blanks, and with something on both sides of each comma.
    let decimals = |row: &str| blanks.words(row).all(|word| !word.ends_with(',') && blanks.number(word).is_some());
    match header_style(row).sign {
        Some(',') if blanks.words(row).count() >= 3 && decimals(row) => blanks,
        Some(',') => Style { sign: Some(','), ..Style::default() },
        sign => Style { sign, decimal_comma: sign.is_some(), ..Style::default() },
    }
}

/// What stands before the points.
struct Layout {
    columns: Vec<Named>,
    style: Style,
    /// Where the points begin, bytes, and the lines before.
    at: u64,
    before: u64,
    /// Whether no header says what the columns are.
    bare: bool,
}

impl Layout {
    fn of(source: &Source) -> Result<Layout> {
        let wanted = source.columns;
        let mut lines = Lines::of(source)?;
        let (mut header, mut wrote_header): (Option<String>, _) = (None, false);
        // Where rows are counted before they come.
        let mut counted = None;
        for _ in 0..BEFORE {
            let (at, before) = (lines.at(), lines.number());
            let Some(line) = lines.next()? else {
                if let (Some(header), None) = (header, wanted) {
                    let columns = named(&header);
                    return Ok(Layout { columns, style: header_style(&header), at, before, bare: false });
                }
                break;
            };
            if line.is_empty() {
                continue;
            }
            if is_comment(line) {
                if has_places(bare(line)) && !wrote_header {
                    header = Some(bare(line).to_owned());
                }
                continue;
            }
            if is_count(line) {
                counted = counted.or(Some((at, before)));
                continue;
            }
            // Rows may begin with words.
            let is_next = header.as_ref().is_some_and(|header| wrote_header || has_columns(line, header));
            if !wanted.map_or(is_next || is_row(line), |wanted| fits(line, wanted)) {
                (header, wrote_header, counted) = (Some(line.to_owned()), true, None);
                continue;
            }
            let mut style = row_style(line);
            style.counts = counted.is_some();
            let words = style.words(line).count();
            let columns = match (wanted, header) {
                (Some(wanted), _) => {
                    let nothing = std::iter::repeat_n(NOTHING, words.saturating_sub(wanted.len()));
                    wanted.iter().map(String::as_str).chain(nothing).map(as_they_are).collect()
                }
                (None, Some(header)) => {
                    let columns = named(&header);
                    if columns.len() != words && wrote_header {
                        style = Style { counts: style.counts, ..header_style(&header) };
                    }
                    // A comment of another length is no header.
                    if columns.len() == words || wrote_header { columns } else { Vec::new() }
                }
                (None, None) => Vec::new(),
            };
            let bare = columns.is_empty();
            let columns = if bare { (0..words).map(|_| as_they_are(NOTHING)).collect() } else { columns };
            if columns.len() > COLUMNS {
                return Err(source.error(format!("has {} columns; allowed: {COLUMNS}", columns.len())));
            }
            let (at, before) = counted.unwrap_or((at, before));
            return Ok(Layout { columns, style, at, before, bare });
        }
        Err(source.error(match wanted {
            Some(wanted) => format!("has no row for the columns {} in its first {BEFORE} lines", wanted.join(",")),
            None => {
                format!("has no rows of points in its first {BEFORE} lines; expected numbers below a header, or alone")
            }
        }))
    }

    /// The lines of the points.
    fn lines<'a>(&self, source: &'a Source<'a>) -> Result<Lines<'a>> {
        Lines::behind(source, self.at, self.before)
    }

    /// Numbers of the first rows; NaN for words.
    fn sample(&self, source: &Source) -> Result<Vec<Vec<f64>>> {
        let mut lines = self.lines(source)?;
        let mut rows = Vec::new();
        while rows.len() < (SAMPLE / self.columns.len().max(1)).max(1) {
            let Some(line) = lines.next()? else { break };
            let row = self.style.words(line).map(|word| self.style.number(word).unwrap_or(f64::NAN));
            let row: Vec<f64> = row.take(self.columns.len()).collect();
            if row.len() == self.columns.len() && !is_comment(line) {
                rows.push(row);
            }
        }
        Ok(rows)
    }
}

/// Whether `line` has as many words as `header`, and numbers among them.
fn has_columns(line: &str, header: &str) -> bool {
    let style = row_style(line);
    let numbers = style.words(line).filter(|word| !word.is_empty() && style.number(word).is_some());
    numbers.count() > 0 && style.words(line).count() == named(header).len()
}

/// Whether `line` has a number for each of the `columns`.
fn fits(line: &str, columns: &[String]) -> bool {
    let style = row_style(line);
    let mut words = style.words(line);
    columns.iter().all(|column| {
        words.next().is_some_and(|word| column == NOTHING || !word.is_empty() && style.number(word).is_some())
    })
}

/// What the columns of rows without a header are likely to be: of three to nine columns, all that programs write.
fn guess(sample: &[Vec<f64>], columns: usize) -> Vec<&'static str> {
    const COLOUR: [&str; 3] = ["red", "green", "blue"];
    const NORMAL: [&str; 3] = ["normal_x", "normal_y", "normal_z"];
    let colours = |from: usize| {
        let values = || sample.iter().filter_map(move |row| row.get(from..from + 3)).flatten();
        let whole = values().all(|value| value.fract() == 0.0 && (0.0..=65535.0).contains(value));
        whole || values().all(|value| (0.0..=1.0).contains(value))
    };
    let normals = |from: usize| {
        let normals = sample.iter().filter_map(|row| row.get(from..from + 3));
        let mut squares = normals.map(|normal| normal.iter().map(|value| value * value).sum::<f64>());
        let unit = |square: f64| (square - 1.0).abs() < 0.05;
        squares.clone().any(unit) && squares.all(|square| square == 0.0 || unit(square))
    };
    let more: Vec<&str> = match columns {
        4 => vec!["intensity"],
        6 if normals(3) => NORMAL.into(),
        6 if colours(3) => COLOUR.into(),
        7 if colours(4) => [&["intensity"], &COLOUR[..]].concat(),
        7 if colours(3) => [&COLOUR[..], &["intensity"]].concat(),
        9 if colours(3) && normals(6) => [COLOUR, NORMAL].concat(),
        _ => Vec::new(),
    };
    let mut names = [&["x", "y", "z"], &more[..]].concat();
    names.resize(columns, NOTHING);
    names
}

/// Fits colours that are not of 8 bits, by the first rows, to 255.
fn fit_colours(goals: &mut [Option<Goal>], sample: &[Vec<f64>], report: &mut Report) {
    let is_colour = |goal: &Goal| matches!(goal.field, Field::Red | Field::Green | Field::Blue) && goal.factor == 1.0;
    let places: Vec<usize> = (0..goals.len()).filter(|&at| goals[at].as_ref().is_some_and(is_colour)).collect();
    let values = || sample.iter().flat_map(|row| places.iter().map(|&at| row[at]));
    let brightest = values().fold(0.0, f64::max);
    let (factor, told) = if brightest > 255.0 {
        (255.0 / 65535.0, "65535")
    } else if brightest <= 1.0 && values().any(|value| value.fract() != 0.0) {
        (255.0, "1")
    } else {
        return;
    };
    report.warn(format!("csv: colours from 0 to {told} are taken as 0 to 255"));
    places.into_iter().for_each(|at| goals[at] = goals[at].map(|goal| Goal::scaled(goal.field, factor)));
}

/// Checks the names of `columns` that a user gives.
///
/// # Errors
/// The first that is none.
pub(super) fn check(columns: &[String]) -> Result<()> {
    let known = |name: &String| {
        let column = as_they_are(name);
        name == NOTHING || names::own(&column).or_else(|| names::foreign(&column)).is_some()
    };
    // Who says what it should be lists all names.
    columns.iter().find(|name| !known(name)).map_or(Ok(()), |name| Field::from_name(name).map(drop))
}

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    let mut beginning = [0; 2];
    let read = source.from(0)?.read(&mut beginning).map_err(|error| Error::io(source.path, error))?;
    if WIDE.contains(&&beginning[..read]) {
        return Err(source.error("is text of 16 bits (UTF-16); allowed: UTF-8"));
    }
    let mut layout = Layout::of(source)?;
    let sample = layout.sample(source)?;
    if layout.bare {
        if is_ptx(source)? {
            return Err(source.error("is a PTX file, of grids with matrices; allowed: XYZ and PTS, or E57"));
        }
        let names = guess(&sample, layout.columns.len());
        let told = names.iter().filter(|&&name| name != NOTHING).copied().collect::<Vec<_>>().join(",");
        let left = match names.iter().filter(|&&name| name == NOTHING).count() {
            0 => String::new(),
            count => format!(", and {count} more are left out"),
        };
        report.warn(format!(
            "csv: no header names its columns, which are taken as {told}{left}; --columns says otherwise"
        ));
        layout.columns = names.into_iter().map(as_they_are).collect();
    }
    if layout.style.sign != Some(',') && has_decimal_commas(&layout, source)? {
        report.warn("csv: commas in its numbers are taken as decimal points");
    }
    let columns = &layout.columns;
    let about = About::beside(source.path)?;
    // Integers have their own unit of time in other formats; here all are seconds.
    let mut goals = rows::goals(columns, "csv", report);
    fit_colours(&mut goals, &sample, report);
    let told = about.as_ref().and_then(|about| about.columns.as_deref()).unwrap_or_default();
    let told = told.iter().filter(|_| source.columns.is_none());
    if let Some(missing) = told.into_iter().find(|name| !columns.iter().any(|column| column.name == **name)) {
        let missing = shown::name(missing);
        return Err(source.error(format!("has no column {missing}, of which its label names tell: it is cut off")));
    }
    let mut rows = Rows::new(rows::fields(&goals), 0, about.as_ref())?;
    let places: Vec<Option<Place>> = goals.into_iter().map(|goal| goal.map(Place::Goal)).collect();
    text::read(layout.lines(source)?, layout.style, &places, None, &mut rows)?;
    rows.finish(source.path, "csv", about.unwrap_or_default(), report)
}

/// Whether the first row has numbers with commas in them.
fn has_decimal_commas(layout: &Layout, source: &Source) -> Result<bool> {
    let (mut lines, style) = (layout.lines(source)?, layout.style);
    while let Some(line) = lines.next()? {
        if !line.is_empty() && !is_comment(line) && !is_count(line) {
            return Ok(style.words(line).any(|word| word.contains(',') && style.number(word).is_some()));
        }
    }
    Ok(false)
}

/// Whether rows and columns, places and matrices come before the points, as in PTX files.
fn is_ptx(source: &Source) -> Result<bool> {
    let mut lines = Lines::of(source)?;
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
        let guessed = |row: &[f64]| guess(&[row.to_vec()], row.len()).join(",");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, -2048.0]), "x,y,z,intensity");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 9.0, 255.0, 0.0]), "x,y,z,red,green,blue");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 0.6, -0.8, 0.0]), "x,y,z,normal_x,normal_y,normal_z");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, -5.0, 255.0, 0.0, 9.0]), "x,y,z,intensity,red,green,blue");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 255.0, 0.0, 9.0, -0.5]), "x,y,z,red,green,blue,intensity");
        assert_eq!(guessed(&[1.0, 2.0, 3.0, 255.0, 0.0]), "x,y,z,_,_");
    }
}
