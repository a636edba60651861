//! `scenes`: how well balls are found under what a real court has, scene by scene.
//!
//! The table goes to stdout, words to stderr. `--write` renews the one in the repository, which a
//! system test compares with; `--overlay` shows what the scenes are.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::Parser;
use tests::contact_sheet::ContactSheet;
use tests::scene_table::{self, Backgrounds, Row};
use tests::scenes::{self, Scene};
use workers::Settings;
use workers::method::{self, Method};

/// A table of scenes: balls found, false candidates, centres.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Names of scenes with commas between; default: all.
    #[arg(long)]
    scenes: Option<String>,
    /// Names of methods with commas between, or all; default: that of the workers.
    #[arg(long)]
    method: Option<String>,
    /// Renew tests/results/scenes.md.
    #[arg(long, conflicts_with_all = ["scenes", "method"])]
    write: bool,
    /// For each scene a picture of what it is and what was found in it (DIR/NAME.png).
    #[arg(long, value_name = "DIR", conflicts_with = "write")]
    overlay: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let scenes = scenes_from_text(flags.scenes.as_deref())?;
    let methods = methods_from_text(flags.method.as_deref())?;
    if let Some(directory) = &flags.overlay {
        ensure!(methods.len() == 1, "--overlay shows one method: name it with --method");
        let rows = drawn(&scenes, &methods[0], directory)?;
        print!("{}", scene_table::text_from(&scenes, &rows));
        return Ok(());
    }
    let rows = scene_table::rows(&scenes, &methods, |words| eprintln!("{words}"));
    print!("{}", scene_table::text_from(&scenes, &rows));
    if flags.write {
        let path = scene_table::snapshot_path();
        std::fs::write(&path, scene_table::document_from(&scenes, &rows))
            .with_context(|| path.display().to_string())?;
        eprintln!("{}", path.display());
    }
    Ok(())
}

/// Plays scenes one after the other, with a picture of each.
fn drawn(scenes: &[Scene], method: &Method, directory: &Path) -> anyhow::Result<Vec<Row>> {
    std::fs::create_dir_all(directory).with_context(|| directory.display().to_string())?;
    let (mut rows, backgrounds) = (Vec::new(), Backgrounds::default());
    for scene in scenes {
        eprintln!("{}, {} …", scene.name, method.name);
        let mut sheet = ContactSheet::default();
        rows.push(scene.play(method, &backgrounds, |played| sheet.update(played)));
        let path = directory.join(format!("{}.png", scene.name));
        sheet.to_image().save(&path).with_context(|| path.display().to_string())?;
    }
    Ok(rows)
}

fn scenes_from_text(text: Option<&str>) -> anyhow::Result<Vec<Scene>> {
    let Some(text) = text else { return Ok(scenes::all()) };
    text.split(',').map(|name| scenes::from_name(name).map_err(anyhow::Error::msg)).collect()
}

fn methods_from_text(text: Option<&str>) -> anyhow::Result<Vec<Method>> {
    match text {
        None => Ok(vec![Settings::DEFAULT.method]),
        Some("all") => Ok(method::all()),
        Some(text) => text
            .split(',')
            .map(|name| Method::from_name(name).map_err(anyhow::Error::msg))
            .collect(),
    }
}
