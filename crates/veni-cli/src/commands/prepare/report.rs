//! `report.json`: every file and what became of it; `report.md`: what a person wants to know.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use serde_json::{Value, json};
use veni_data::prepare::Split;

use super::place::{Kept, Placed, Placing};
use super::record::Record;
use super::store::{Settings, Store, write_bytes, write_json};
use crate::printable::printable;
use crate::report::{Outcome, Report};

pub(super) fn write(
    store: &Store,
    settings: &Settings,
    placing: &Placing,
    placed: &Placed,
    ignored: &[PathBuf],
    gone: &[String],
) -> Result<()> {
    let ignored: Vec<String> = ignored.iter().map(|p| p.display().to_string()).collect();
    let mut files: Vec<Value> = placed.kept.iter().map(kept).collect();
    files.extend(placed.duplicates.iter().map(|(record, of)| {
        json!({"source": record.source, "fate": "duplicate", "of": of, "reason": "the same bytes"})
    }));
    files.extend(
        (placed.refused.iter())
            .map(|(source, reason)| json!({"source": source, "fate": "refused", "reason": reason})),
    );
    files.extend(
        ignored
            .iter()
            .map(|path| json!({"source": path, "fate": "ignored", "reason": "no image by name or content"})),
    );
    files.sort_by(|a, b| a["source"].as_str().cmp(&b["source"].as_str()));
    let alike: Vec<Value> = placed.alike.iter().map(|(first, second, bond)| {
        let l = bond.likeness;
        json!({
            "first": first, "second": second, "correlation": l.around, "rotation_degrees": l.rotation.to_degrees(),
            "mirrored": l.mirrored,
        })
    }).collect();
    let value = json!({
        "settings": settings,
        "seed": placing.seed,
        "shares": placing.shares,
        "counts": counts(placed, ignored.len(), gone.len()),
        "files": files,
        "gone": gone,
        "near_duplicates": alike,
    });
    write_json(&store.root().join("report.json"), &value)?;
    write_bytes(
        &store.root().join("report.md"),
        markdown(settings, placing, placed, &ignored, gone)?.as_bytes(),
    )
}

/// The result of the command; files that were refused make it a negative one.
pub(super) fn print(output: &Path, placed: &Placed, gone: &[String], report: Report) -> Result<Outcome> {
    let refused: Vec<Value> =
        placed.refused.iter().map(|(source, reason)| json!({"source": source, "reason": reason})).collect();
    let mut value = counts(placed, 0, gone.len());
    if let Value::Object(map) = &mut value {
        map.remove("ignored");
        map.insert("folder".into(), json!(output.display().to_string()));
        map.insert("refusals".into(), json!(refused));
    }
    let sides: Vec<String> = Split::ALL.iter().map(|s| format!("{} {s}", side(placed, *s))).collect();
    let human = format!(
        "{}: {} panoramas ({}), {} duplicates, {} refused; see report.md and contact.png there",
        output.display(),
        placed.kept.len(),
        sides.join(", "),
        placed.duplicates.len(),
        placed.refused.len()
    );
    report.result(human, &value)?;
    Ok(if placed.refused.is_empty() { Outcome::Fine } else { Outcome::Negative })
}

fn side(placed: &Placed, split: Split) -> usize {
    placed.kept.iter().filter(|k| k.split == split).count()
}

fn counts(placed: &Placed, ignored: usize, gone: usize) -> Value {
    json!({
        "kept": placed.kept.len(),
        "train": side(placed, Split::Train),
        "val": side(placed, Split::Val),
        "test": side(placed, Split::Test),
        "expanded": placed.kept.iter().filter(|k| k.record.facts().is_some_and(|f| f.expanded.is_some())).count(),
        "duplicates": placed.duplicates.len(),
        "refused": placed.refused.len(),
        "ignored": ignored,
        "gone": gone,
    })
}

fn kept(kept: &Kept) -> Value {
    let Some(facts) = kept.record.facts() else { return Value::Null };
    json!({
        "source": kept.record.source,
        "fate": "kept",
        "file": kept.file,
        "split": kept.split,
        "given_split": kept.record.given,
        "capture": kept.record.capture(),
        "group": kept.group,
        "content": facts.id,
        "width": facts.width,
        "height": facts.height,
        "stops_median_to_brightest": facts.stops,
        "log_exposure": facts.log_exposure,
        "replaced": facts.replaced,
        "expanded": facts.expanded,
        "notes": facts.notes,
    })
}

fn markdown(
    settings: &Settings,
    placing: &Placing,
    placed: &Placed,
    ignored: &[String],
    gone: &[String],
) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    let Settings { width, height, .. } = settings;
    let expand = settings.expansion();
    writeln!(out, "# Prepared panoramas\n")?;
    writeln!(
        out,
        "{width} × {height} pixels, half-float EXR; LDR expansion: {expand}; seed {}.\n",
        placing.seed
    )?;
    writeln!(out, "| | panoramas | groups |\n|---|---|---|")?;
    for split in Split::ALL {
        let mut groups: Vec<_> = placed.kept.iter().filter(|k| k.split == split).map(|k| &k.group).collect();
        let count = groups.len();
        groups.sort();
        groups.dedup();
        writeln!(out, "| {split} | {count} | {} |", groups.len())?;
    }
    writeln!(
        out,
        "\n{} files are not here: {} refused, {} duplicates, {} no images.",
        placed.refused.len() + placed.duplicates.len() + ignored.len(),
        placed.refused.len(),
        placed.duplicates.len(),
        ignored.len()
    )?;
    section(&mut out, "Kept, though their sources are gone", gone.iter().cloned())?;
    section(
        &mut out,
        "Refused",
        placed.refused.iter().map(|(source, reason)| format!("{source}: {reason}")),
    )?;
    section(
        &mut out,
        "Duplicates, byte for byte",
        placed.duplicates.iter().map(|(r, of)| format!("{} is {of}", r.source)),
    )?;
    section(
        &mut out,
        "Near-duplicates, kept on one side",
        placed.alike.iter().map(|(first, second, bond)| {
            let l = bond.likeness;
            let mirrored = if l.mirrored { ", mirrored" } else { "" };
            format!(
                "{first} and {second}: correlation {:.3}, rotated by {:.0}°{mirrored}",
                l.around,
                l.rotation.to_degrees().round() + 0.0
            )
        }),
    )?;
    let mut groups: BTreeMap<&str, Vec<&Kept>> = BTreeMap::new();
    placed.kept.iter().for_each(|k| groups.entry(&k.group).or_default().push(k));
    section(
        &mut out,
        "Groups of several, by name or content",
        groups.iter().filter(|(_, all)| all.len() > 1).map(|(group, all)| {
            let files: Vec<_> = all.iter().map(|k| k.file.as_str()).collect();
            format!("{group}: {}", files.join(", "))
        }),
    )?;
    let moved =
        placed.kept.iter().filter(|k| !placing.resplit && k.record.given.is_some_and(|g| g != k.split));
    section(
        &mut out,
        "Moved to the other side of a near-duplicate",
        moved.map(|k| format!("{} → {}", k.record.source, k.file)),
    )?;
    section(
        &mut out,
        "Expanded from a limited range",
        placed.kept.iter().filter_map(|k| expanded(&k.record, &k.file)),
    )?;
    section(&mut out, "Values replaced", placed.kept.iter().filter_map(|k| replaced(&k.record, &k.file)))?;
    section(
        &mut out,
        "Worth knowing",
        placed.kept.iter().flat_map(|k| {
            let notes = k.record.facts().map_or(&[][..], |f| &f.notes);
            notes.iter().map(|note| format!("{}: {note}", k.file))
        }),
    )?;
    section(&mut out, "No images", ignored.iter().cloned())?;
    Ok(out)
}

fn section(out: &mut String, title: &str, lines: impl Iterator<Item = String>) -> std::fmt::Result {
    for (at, line) in lines.enumerate() {
        if at == 0 {
            writeln!(out, "\n## {title}\n")?;
        }
        writeln!(out, "- {}", printable(&line))?;
    }
    Ok(())
}

fn expanded(record: &Record, file: &str) -> Option<String> {
    let expanded = record.facts()?.expanded.as_ref()?;
    if let Some(network) = &expanded.network {
        return Some(format!(
            "{file}: {:.1} % clipped, by {}, times {:.4}, {:.1} % of the clipped values darker than stored",
            100.0 * expanded.clipped,
            network.model,
            network.factor,
            100.0 * network.below
        ));
    }
    let sun = match expanded.sun_direction {
        Some([.., z]) => format!("a sun {:.0}° above the horizon", z.asin().to_degrees()),
        None => "no sun".to_owned(),
    };
    Some(format!("{file}: {:.1} % clipped, {sun}", 100.0 * expanded.clipped))
}

fn replaced(record: &Record, file: &str) -> Option<String> {
    let r = record.facts()?.replaced;
    let all = r.nan + r.infinite + r.negative;
    (all > 0)
        .then(|| format!("{file}: {} not a number, {} infinite, {} negative", r.nan, r.infinite, r.negative))
}
