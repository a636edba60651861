//! `sessions`: how soon a ball machine that is off hits its targets, by whom it is corrected.
//!
//! The tables go to stdout, words to stderr. `--write` renews those in the repository; `--json`
//! keeps every ball, to find the one that went wrong.

use std::path::PathBuf;

use anyhow::Context as _;
use clap::Parser;
use tests::machine::actuators::Build;
use tests::sessions::figures::{Row, scatter_m};
use tests::sessions::played::Session;
use tests::sessions::scene::Scene;
use tests::sessions::{self, Amount, Variant, controllers, table};

/// Simulated sessions of a ball machine in a closed loop.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// Sessions of each scene, machine and controller.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    sessions: u32,
    /// Balls of each session.
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u32).range(1..=1000))]
    balls: u32,
    /// real, precise, or both with a comma between; default: both.
    #[arg(long, default_value = "real,precise")]
    machine: String,
    /// Scenes with commas between; default: all.
    #[arg(long)]
    scene: Option<String>,
    /// Controllers with commas between; default: all, but `integrator` with scene `bias` alone.
    #[arg(long)]
    controller: Option<String>,
    /// So many sessions with rendered frames as well, of scene `bias` if none is named: a minute
    /// each.
    #[arg(long, value_name = "N", default_value_t = 0)]
    rendered: u32,
    /// The first session's; each other one has the next.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Every ball of every session.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// The tables, with their head.
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Renew tests/results/sessions.md and sessions.csv.
    #[arg(long)]
    write: bool,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let drawn = variants_from_flags(&flags, false)?;
    let amount = Amount {
        n_sessions: flags.sessions as usize,
        n_balls: flags.balls as usize,
        first_seed: flags.seed,
    };
    let say = |words: &str| eprintln!("{words}");
    let mut variants = drawn;
    let mut all = sessions::all(&variants, &amount, say);
    if flags.rendered > 0 {
        let rendered = variants_from_flags(&flags, true)?;
        let amount = Amount { n_sessions: flags.rendered as usize, ..amount };
        all.extend(sessions::all(&rendered, &amount, say));
        variants.extend(rendered);
    }
    let rows = rows_from(&variants, &all);
    print!("{}", table::text_from(&rows));
    if let Some(path) = &flags.json {
        write(path, &format!("{}\n", table::json_from(&variants, &all)))?;
    }
    let document = table::document_from(&rows, &command());
    if let Some(path) = &flags.table {
        write(path, &document)?;
    }
    if flags.write {
        write(&table::snapshot_path(), &document)?;
        write(&table::lines_path(), &table::lines_from(&variants, &all))?;
    }
    Ok(())
}

fn write(path: &std::path::Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| path.display().to_string())?;
    eprintln!("{}", path.display());
    Ok(())
}

/// What makes the same tables again.
fn command() -> String {
    let flags: Vec<String> = std::env::args().skip(1).collect();
    ["cargo run --release -p tests --bin sessions --".to_owned(), flags.join(" ")].join(" ")
}

fn variants_from_flags(flags: &Flags, is_rendered: bool) -> anyhow::Result<Vec<Variant>> {
    let scenes = match &flags.scene {
        Some(text) => text.split(',').map(Scene::from_name).collect::<Result<Vec<_>, _>>(),
        None => Ok(Scene::ALL.to_vec()),
    };
    let builds: Result<Vec<Build>, String> =
        flags.machine.split(',').map(Build::from_name).collect();
    let known = |name: &str| {
        controllers::from_name(name, &Build::REAL)?;
        Ok(controllers::NAMES.into_iter().find(|known| *known == name))
    };
    let chosen: Result<Vec<Option<&'static str>>, String> = match &flags.controller {
        Some(text) => text.split(',').map(known).collect(),
        None => Ok(controllers::NAMES.map(Some).to_vec()),
    };
    let chosen: Vec<&'static str> =
        chosen.map_err(anyhow::Error::msg)?.into_iter().flatten().collect();
    let builds = builds.map_err(anyhow::Error::msg)?;
    let mut variants = Vec::new();
    let is_wanted = |scene: &Scene| flags.scene.is_some() || !is_rendered || *scene == Scene::Bias;
    for scene in scenes.map_err(anyhow::Error::msg)?.into_iter().filter(is_wanted) {
        for &build in &builds {
            let is_default = flags.controller.is_none();
            let is_asked = |name: &&&str| match **name {
                // Who never looks needs no pictures.
                "none" => !is_rendered,
                "integrator" => !is_default || (scene == Scene::Bias && !is_rendered),
                _ => true,
            };
            let looking = chosen.iter().filter(is_asked);
            variants.extend(looking.map(|&controller| Variant {
                scene,
                build,
                controller,
                is_rendered,
            }));
        }
    }
    Ok(variants)
}

fn rows_from(variants: &[Variant], all: &[Vec<Session>]) -> Vec<Row> {
    let none_of = |variant: &Variant| {
        let same = variants.iter().position(|other| {
            (other.scene, other.build) == (variant.scene, variant.build)
                && other.controller == "none"
        })?;
        Some(all[same].as_slice())
    };
    let row = |(variant, sessions): (&Variant, &Vec<Session>)| {
        let scatter_m = scatter_m(variant.build, variant.scene);
        Row::from_sessions(*variant, sessions, none_of(variant), scatter_m)
    };
    variants.iter().zip(all).map(row).collect()
}
