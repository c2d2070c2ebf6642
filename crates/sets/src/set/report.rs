//! Statistics of a set, for programs and for people.

use super::files::replace;
use super::manifest::{Entry, FileEntry, RANGE_STEP_M, drawn_file};
use super::names::numbered;
use super::noticed::Kinds;
use super::origin::Origin;
use ground::error::{Error, Result};
use ground::read::{self, Limit};
use ground::write;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// Values of one parameter over all samples.
#[derive(Debug)]
enum DrawnValues {
    Numbers(Vec<f64>),
    /// How often each was drawn.
    Others(BTreeMap<String, u64>),
}

/// Maximum number of different values that are counted one by one.
const MOST_OTHERS: usize = 1000;

/// Writes `report.json`, `report.html`, and the pictures combined in `contact_sheet.png`.
///
/// # Errors
/// I/O errors.
pub(super) fn write(root: &Path, origin: &Origin, entries: &BTreeMap<u64, Entry>) -> Result<()> {
    let entries = || entries.range(..origin.samples).map(|(_, entry)| entry);
    let mut categories: BTreeMap<&str, u64> = BTreeMap::new();
    let mut ranges: Vec<u64> = Vec::new();
    let mut empty: BTreeMap<&str, u64> = BTreeMap::new();
    let mut noticed = Kinds::default();
    let mut drawn: BTreeMap<String, DrawnValues> = BTreeMap::new();
    for entry in entries() {
        for (name, count) in &entry.categories {
            *categories.entry(name).or_default() += count;
        }
        ranges.resize(ranges.len().max(entry.ranges.len()), 0);
        ranges.iter_mut().zip(&entry.ranges).for_each(|(sum, count)| *sum += count);
        for (name, count) in &entry.empty {
            *empty.entry(name).or_default() += count;
        }
        noticed.add(entry.sample, &entry.warnings);
        if entry.error.is_none() {
            collect(&root.join(drawn_file(entry.sample)), &mut drawn)?;
        }
    }
    let failed: Vec<&Entry> = entries().filter(|entry| entry.error.is_some()).collect();
    let bytes: u64 = entries().flat_map(|entry| &entry.files).map(|file| file.bytes).sum();
    let points: u64 = entries().map(|entry| entry.points).sum();
    let drawn: serde_json::Map<String, Value> =
        drawn.into_iter().map(|(name, values)| (name, values.to_json())).collect();
    let report = json!({
        "samples": origin.samples,
        "failed": failed.iter().map(|entry| json!({"sample": entry.sample, "error": entry.error})).collect::<Vec<_>>(),
        "points": points,
        "bytes": bytes,
        "categories": categories,
        "empty": empty,
        "ranges": {"step_m": RANGE_STEP_M, "points": ranges},
        "drawn": drawn,
        "warnings": noticed.notices(),
        "echocast": origin.echocast,
    });
    let text = serde_json::to_string_pretty(&report).map_err(|error| Error::Internal(error.to_string()))? + "\n";
    replace(&root.join("report.json"), text.as_bytes())?;
    let pictures = pictures(root, entries())?;
    if !pictures.is_empty() {
        let path = root.join("contact_sheet.png");
        let sheet = ::pictures::sheet(pictures.iter().map(|(_, file)| file))
            .to_png()
            .map_err(|source| write::failed(&path, source))?;
        replace(&path, &sheet)?;
    }
    replace(&root.join("report.html"), page(&report, &pictures).as_bytes())
}

/// Adds the values drawn for a sample to those of others.
fn collect(path: &Path, drawn: &mut BTreeMap<String, DrawnValues>) -> Result<()> {
    let bytes = read::bytes(path, Limit::YAML)?;
    let sample: Value = serde_json::from_slice(&bytes).map_err(|error| Error::parse(path, "", error.to_string()))?;
    for entry in sample["drawn"].as_array().into_iter().flatten() {
        let rule = entry["rule"].as_str().unwrap_or_default();
        let values = entry.as_object().into_iter().flatten();
        let shown = |key: &str| !["rule", "object", "key", "orientation_xyzw"].contains(&key);
        for (key, value) in values.filter(|(key, _)| shown(key)) {
            let name = if key == "value" { rule.to_owned() } else { format!("{rule}: {key}") };
            match value {
                Value::Array(axes) if axes.iter().all(Value::is_number) => {
                    for (axis, value) in axes.iter().enumerate() {
                        add(drawn, format!("{name} [{axis}]"), value);
                    }
                }
                value => add(drawn, name, value),
            }
        }
    }
    Ok(())
}

fn add(drawn: &mut BTreeMap<String, DrawnValues>, name: String, value: &Value) {
    let numeric = value.as_f64();
    let known = drawn.entry(name).or_insert_with(|| match numeric {
        Some(_) => DrawnValues::Numbers(Vec::new()),
        None => DrawnValues::Others(BTreeMap::new()),
    });
    match (known, numeric) {
        (DrawnValues::Numbers(all), Some(number)) => all.push(number),
        (DrawnValues::Numbers(_), None) => {}
        (DrawnValues::Others(all), _) => {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            if all.len() < MOST_OTHERS || all.contains_key(&text) {
                *all.entry(text).or_default() += 1;
            }
        }
    }
}

impl DrawnValues {
    fn to_json(&self) -> Value {
        /// Number of bins of a histogram.
        const STEPS: usize = 20;
        match self {
            DrawnValues::Numbers(all) => {
                let low = all.iter().copied().fold(f64::INFINITY, f64::min);
                let high = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let mut counts = vec![0_u64; STEPS];
                for value in all {
                    let part = if high > low { (value - low) / (high - low) } else { 0.0 };
                    counts[((part * STEPS as f64) as usize).min(STEPS - 1)] += 1;
                }
                let mean = all.iter().sum::<f64>() / all.len() as f64;
                json!({"count": all.len(), "min": low, "mean": mean, "max": high, "histogram": counts})
            }
            DrawnValues::Others(all) => json!({ "count": all.values().sum::<u64>(), "values": all }),
        }
    }
}

/// The pictures of samples, by name.
fn pictures<'e>(root: &Path, entries: impl Iterator<Item = &'e Entry>) -> Result<Vec<(String, Vec<u8>)>> {
    let name = |path: &'e str| path.strip_prefix("pictures/")?.strip_suffix(".png");
    let names = entries.flat_map(|entry| &entry.files).filter_map(|file| Some((file, name(&file.path)?)));
    let picture = |(file, name): (&FileEntry, &str)| {
        let bytes = read::bytes(&root.join(&file.path), Limit::SCENE)?;
        Ok((name.to_owned(), bytes))
    };
    names.map(picture).collect()
}

/// The page, self-contained.
fn page(report: &Value, pictures: &[(String, Vec<u8>)]) -> String {
    const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:75rem;padding:0 1rem;\
        background:#16171b;color:#e6e6e6}h1{font-weight:500}h2{font-weight:500;margin-top:2.2rem}\
        table{border-collapse:collapse}td,th{padding:.15rem .9rem .15rem 0;text-align:left;vertical-align:middle}\
        td.n{text-align:right;font-variant-numeric:tabular-nums}.bar{background:#56b4e9;height:.8rem;border-radius:2px}\
        .pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(18rem,1fr));gap:.8rem}\
        figure{margin:0}img{width:100%;border-radius:4px}figcaption,.dim{color:#9a9aa2}\
        svg{background:#1e2026;border-radius:3px}.bad{color:#ff8f6b}";
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Set of samples</title>\n\
         <style>{STYLE}</style></head><body>\n<h1>Set of {} samples</h1>\n",
        grouped(&report["samples"])
    );
    let failed = report["failed"].as_array().map_or(0, Vec::len);
    let size = report["bytes"].as_f64().unwrap_or(0.0) / f64::from(1 << 20);
    let _ = writeln!(
        html,
        "<p id=\"summary\">{} points in {size:.1} MiB; {failed} samples have failed. Made by echocast {}.</p>",
        grouped(&report["points"]),
        escaped(report["echocast"].as_str().unwrap_or_default())
    );
    if !pictures.is_empty() {
        html += "<h2>The first samples</h2>\n<div class=\"pictures\">\n";
        for (name, bytes) in pictures {
            let _ = writeln!(
                html,
                "<figure><img alt=\"sample {0}\" src=\"data:image/png;base64,{1}\"><figcaption>sample \
                 {0}</figcaption></figure>",
                escaped(name),
                base64(bytes)
            );
        }
        html += "</div>\n";
    }
    html += "<h2>Points by category</h2>\n<table id=\"categories\">\n";
    let categories = report["categories"].as_object();
    let mut rows: Vec<(&str, u64)> =
        categories.into_iter().flatten().map(|(name, count)| (name.as_str(), count.as_u64().unwrap_or(0))).collect();
    rows.sort_by_key(|&(name, count)| (std::cmp::Reverse(count), name.to_owned()));
    bars(&mut html, &rows);
    html += "</table>\n<h2>Points by range</h2>\n<table id=\"ranges\">\n";
    let ranges = report["ranges"]["points"].as_array();
    let steps: Vec<(String, u64)> = ranges
        .into_iter()
        .flatten()
        .enumerate()
        .map(|(step, count)| {
            let from = step as f64 * RANGE_STEP_M;
            (format!("{from} to {} m", from + RANGE_STEP_M), count.as_u64().unwrap_or(0))
        })
        .collect();
    bars(&mut html, &steps.iter().map(|(name, count)| (name.as_str(), *count)).collect::<Vec<_>>());
    html += "</table>\n";
    let drawn = report["drawn"].as_object().filter(|drawn| !drawn.is_empty());
    if let Some(drawn) = drawn {
        html += "<h2>What was drawn</h2>\n<table id=\"drawn\">\n";
        for (name, values) in drawn {
            let _ =
                write!(html, "<tr><td>{}</td><td class=\"n\">{}</td><td>", escaped(name), grouped(&values["count"]));
            match values["values"].as_object() {
                Some(others) => {
                    let shown: Vec<String> = others
                        .iter()
                        .take(12)
                        .map(|(value, count)| {
                            format!("{} <span class=\"dim\">{}</span>", escaped(value), grouped(count))
                        })
                        .collect();
                    html += &shown.join(", ");
                    if others.len() > 12 {
                        let _ = write!(html, " and {} more", others.len() - 12);
                    }
                }
                None => {
                    html += &histogram(&values["histogram"]);
                    let number =
                        |key: &str| values[key].as_f64().map_or_else(String::new, |number| format!("{number:.4}"));
                    let _ = write!(html, " {} to {}, mean {}", number("min"), number("max"), number("mean"));
                }
            }
            html += "</td></tr>\n";
        }
        html += "</table>\n";
    }
    if failed > 0 {
        html += "<h2>Failed</h2>\n<table id=\"failed\">\n";
        for entry in report["failed"].as_array().into_iter().flatten() {
            let error = escaped(entry["error"].as_str().unwrap_or_default());
            let _ = writeln!(html, "<tr><td class=\"n\">{}</td><td class=\"bad\">{error}</td></tr>", entry["sample"]);
        }
        html += "</table>\n";
    }
    if let Some(warnings) = report["warnings"].as_array().filter(|warnings| !warnings.is_empty()) {
        html += "<h2>Noticed</h2>\n<table id=\"warnings\">\n";
        for noticed in warnings {
            let (count, warning) = (grouped(&noticed["samples"]), noticed["warning"].as_str().unwrap_or_default());
            let _ = writeln!(
                html,
                "<tr><td class=\"n\">{count}</td><td>{} <span class=\"dim\">sample {}</span></td></tr>",
                escaped(warning),
                numbered(noticed["first"].as_u64().unwrap_or(0))
            );
        }
        html += "</table>\n";
    }
    html + "</body></html>\n"
}

/// Rows of a table with a bar each.
fn bars(html: &mut String, rows: &[(&str, u64)]) {
    let most = rows.iter().map(|(_, count)| *count).max().unwrap_or(1).max(1);
    for (name, count) in rows {
        let width = 30.0 * *count as f64 / most as f64;
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"n\">{}</td><td><div class=\"bar\" style=\"width:{width:.2}rem\"></div></td></tr>",
            escaped(name),
            grouped(&json!(count))
        );
    }
}

fn histogram(counts: &Value) -> String {
    let counts: Vec<f64> = counts.as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    let most = counts.iter().copied().fold(1.0, f64::max);
    let mut svg = format!("<svg width=\"{}\" height=\"24\">", 6 * counts.len());
    for (step, count) in counts.iter().enumerate() {
        let height = 22.0 * count / most;
        let _ = write!(
            svg,
            "<rect x=\"{}\" y=\"{:.1}\" width=\"5\" height=\"{height:.1}\" fill=\"#e69f00\"/>",
            6 * step,
            23.0 - height
        );
    }
    svg + "</svg>"
}

/// A number of a report, with grouped digits.
fn grouped(number: &Value) -> String {
    ::pictures::thousands(number.as_u64().unwrap_or(0) as usize)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Base64 (RFC 4648, section 4).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = [0, 1, 2].map(|k| u32::from(chunk.get(k).copied().unwrap_or(0)));
        let word = word[0] << 16 | word[1] << 8 | word[2];
        for k in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * k) & 63) as usize];
            text.push(if k <= chunk.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_digits() {
        // The test vectors of RFC 4648.
        let of = |text: &str| base64(text.as_bytes());
        assert_eq!(
            [of(""), of("f"), of("fo"), of("foo"), of("foob"), of("fooba"), of("foobar")],
            ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"]
        );
    }

    #[test]
    fn names_cannot_leave_their_place_in_the_page() {
        let report = json!({"samples": 1, "points": 1234567, "bytes": 0, "echocast": "1", "failed": [],
            "categories": {"<script>alert(1)</script>": 3}, "ranges": {"points": [3]}, "drawn": {}, "warnings": []});
        let page = page(&report, &[]);
        assert!(!page.contains("<script>") && page.contains("&lt;script&gt;") && page.contains("1,234,567 points"));
    }
}
