//! Rows -> four tables as Markdown: bounces; launches and clocks; sightings; delays and costs.
//!
//! Here degrees, percent, mm and rpm may appear. A dash is "not measured, or nothing to measure".

use std::path::{Path, PathBuf};

use super::cells::Cell;
use super::row::{Row, Spread};

/// Where the tables stand in the repository.
pub fn snapshot_path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("results/accuracy.md")
}

/// All four tables.
pub fn text_from(rows: &[Row]) -> String {
    [bounces(rows), launches(rows), sightings(rows), costs(rows)].join("\n")
}

/// What stands in the repository: the tables, and what each cell has in it.
pub fn document_from(cells: &[Cell], rows: &[Row], seed: u64) -> String {
    let mut text = format!(
        "# How well shots are measured, cell by cell\n\n\
         Written by `cargo run --release -p tests --bin accuracy -- --pixels --write`, from seed \
         {seed} on.\nErrors are measured less true.\n\n\
         - RMSE, p95 and worst are distances on the ground.\n\
         - Lost: no measured shot bounces within 0.1 s and 1 m of it. Invented: nobody served it. \
         Not whole:\n  told, yet not as measured.\n\
         - \"in 95 %\" is the share of truths within the stated ellipse; \"in 2σ\" that of \
         speed, elevation,\n  azimuth and spin within two of their stated sigmas: 95 if they are \
         honest.\n\
         - \"bound\" is RMSE over the least that these candidates allow (Cramér and Rao).\n\
         - A delay is from the bounce to the exposure of the frame that makes the shot be told.\n\
         - Times are those of the machine this was written on, with two streams at once.\n\n",
    );
    text += &text_from(rows);
    text += "\n## What is in them\n\n";
    for cell in cells {
        text += &format!("- `{}`: {}.\n", cell.name, cell.contains);
    }
    text
}

fn bounces(rows: &[Row]) -> String {
    let mut text = String::from(
        "| cell | served | measured | lost | invented | not whole | bias x mm | bias y mm \
         | RMSE mm | p95 mm | worst mm | in 95 % | bound |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for row in rows {
        let mm = |value_m: Option<f64>| number(value_m.map(|v| v * 1e3), 1);
        text += &format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            row.cell,
            row.n_served,
            row.n_measured,
            row.n_lost(),
            row.n_invented,
            row.n_not_whole,
            signed(row.bias_m[0].map(|v| v * 1e3), 1),
            signed(row.bias_m[1].map(|v| v * 1e3), 1),
            mm(row.rmse_m),
            mm(row.p95_m),
            mm(row.worst_m),
            number(row.covered_percent, 0),
            number(row.over_bound, 2),
        );
    }
    text
}

fn launches(rows: &[Row]) -> String {
    let mut text = String::from(
        "| cell | speed p95 % | elevation p95 ° | azimuth p95 ° | spin p95 rpm | in 2σ % \
         | bounce time RMS ms | clock RMS ms | clock σ ms | clock in 2σ % |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    let per_rad = [100.0, 1f64.to_degrees(), 1f64.to_degrees(), 60.0 / std::f64::consts::TAU];
    for row in rows {
        let p95 =
            |idx: usize, n_digits| number(row.launch[idx].p95.map(|v| v * per_rad[idx]), n_digits);
        let within = |s: &Spread| number(s.within_2_sigma_percent, 0);
        text += &format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            row.cell,
            p95(0, 2),
            p95(1, 3),
            p95(2, 3),
            p95(3, 0),
            row.launch.iter().map(within).collect::<Vec<_>>().join(" / "),
            number(row.bounce_time_rms_s.map(|v| v * 1e3), 2),
            number(row.clock.rms.map(|v| v * 1e3), 3),
            number(row.clock.stated.map(|v| v * 1e3), 3),
            within(&row.clock),
        );
    }
    text
}

fn sightings(rows: &[Row]) -> String {
    let mut text = String::from(
        "| cell | balls found % | false/frame | RMS x px | RMS y px | bias x px | bias y px \
         | stated σ px |\n|---|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for row in rows {
        let seen = &row.sightings;
        text += &format!(
            "| {} | {} | {} | {} | {} | {} |\n",
            row.cell,
            number(seen.found_percent(), 1),
            number(seen.false_per_frame(), 2),
            seen.rms_px().map(|px| number(px, 3)).join(" | "),
            seen.bias_px().map(|px| signed(px, 3)).join(" | "),
            number(seen.stated_px(), 3),
        );
    }
    text
}

fn costs(rows: &[Row]) -> String {
    let mut text = String::from(
        "| cell | delay median ms | delay worst ms | told at the end | frame median µs \
         | frame mean µs | telling frame median µs | worst frame µs | first minute, mean µs \
         | last minute, mean µs |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for row in rows {
        let delays = row.delay_s.map(|value_s| number(value_s.map(|v| v * 1e3), 0));
        let micro = |value_ms: Option<f64>| number(value_ms.map(|v| v * 1e3), 1);
        text += &format!(
            "| {} | {} | {} | {} | {} |\n",
            row.cell,
            delays.join(" | "),
            row.n_told_at_end,
            row.frame_ms.map(micro).join(" | "),
            row.minute_ms.map(micro).join(" | "),
        );
    }
    text
}

fn number(value: Option<f64>, n_digits: usize) -> String {
    value.map_or("–".to_owned(), |v| format!("{v:.n_digits$}"))
}

fn signed(value: Option<f64>, n_digits: usize) -> String {
    value.map_or("–".to_owned(), |v| format!("{v:+.n_digits$}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_a_table_has_as_many_columns_as_its_head() {
        let text = text_from(&[Row::from_scores("clean", &[])]);
        assert!(text.contains("| clean | 0 | 0 | 0 | 0 | 0 | – | – | – | – | – | – | – |"));
        for table in text.split("\n\n") {
            let n_columns = |line: &str| line.matches('|').count();
            let first = table.lines().next().map(n_columns);
            assert!(table.lines().all(|line| Some(n_columns(line)) == first), "{table}");
        }
    }
}
