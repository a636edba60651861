//! `calibrate siting`: where cameras could stand, or do, in; coverage and expected sigmas out.

use crate::files::rig_from;
use crate::import::size_px;
use anyhow::Context;
use fusion::calibration::siting::flights::Watch;
use fusion::calibration::siting::report::{CellView, Report};
use fusion::calibration::siting::{Site, picture};
use std::path::{Path, PathBuf};

/// What cameras see of the court from a place, and how well they would measure there. The defaults
/// are the thesis' rig (Appendix D).
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Height of both cameras
    #[arg(long, default_value_t = 3.5, allow_negative_numbers = true)]
    height_m: f64,
    /// Distance between them
    #[arg(long, default_value_t = 4.0, allow_negative_numbers = true)]
    baseline_m: f64,
    /// How far they look down
    #[arg(long, default_value_t = 10.0, allow_negative_numbers = true)]
    tilt_deg: f64,
    /// How far each is turned towards the other
    #[arg(long, default_value_t = 6.0, allow_negative_numbers = true)]
    toe_in_deg: f64,
    /// Focal length
    #[arg(long, default_value_t = 1240.0, allow_negative_numbers = true)]
    focal_px: f64,
    /// Horizontal field of view, in place of the focal length
    #[arg(long, conflicts_with = "focal_px", allow_negative_numbers = true)]
    field_deg: Option<f64>,
    /// Size of the image
    #[arg(long, default_value = "640x480", value_parser = size_px)]
    image: [u32; 2],
    /// A rig that stands already, in place of all of the above
    #[arg(long, conflicts_with_all = ["height_m", "baseline_m", "tilt_deg", "toe_in_deg",
        "focal_px", "field_deg", "image"])]
    rig: Option<PathBuf>,
    /// 1 sigma of a ball's centre, each axis
    #[arg(long, default_value_t = 0.3, allow_negative_numbers = true)]
    noise_px: f64,
    /// Frames of each camera in a second
    #[arg(long, default_value_t = 90.0, allow_negative_numbers = true)]
    rate_hz: f64,
    /// Count a ball behind the net as seen
    #[arg(long)]
    through_net: bool,
    /// Where to draw the picture, as SVG
    #[arg(long)]
    out: Option<PathBuf>,
    /// Where to write everything as JSON; - is stdout
    #[arg(long)]
    json: Option<PathBuf>,
}

/// Computes, writes, and says the most important.
pub fn run(args: &Args) -> anyhow::Result<()> {
    if let Some(path) = &args.out {
        let is_svg = path.extension().is_some_and(|extension| extension == "svg");
        anyhow::ensure!(is_svg, "{}: expected a name that ends in .svg", path.display());
    }
    let rig = match &args.rig {
        Some(path) => rig_from(path)?,
        None => site(args)?.rig()?,
    };
    let Args { rate_hz, noise_px, through_net, .. } = *args;
    let watch = Watch { rate_hz, noise_px, is_net_clear: through_net };
    let report = Report::new(&rig, &watch)?;
    let is_stdout = args.json.as_deref() == Some(Path::new("-"));
    if let Some(path) = &args.out {
        written(path, &picture::svg(&report))?;
    }
    if let Some(path) = &args.json {
        let json = serde_json::to_string_pretty(&report)? + "\n";
        if is_stdout { print!("{json}") } else { written(path, &json)? }
    }
    if !is_stdout {
        say(&report);
    }
    Ok(())
}

fn site(args: &Args) -> anyhow::Result<Site> {
    let focal_px = match args.field_deg {
        None => args.focal_px,
        Some(field_deg) => {
            anyhow::ensure!(
                (0.1..=170.0).contains(&field_deg),
                "field of view is {field_deg} degrees, expected 0.1 to 170"
            );
            f64::from(args.image[0]) / 2.0 / (field_deg.to_radians() / 2.0).tan()
        }
    };
    Ok(Site {
        height_m: args.height_m,
        baseline_m: args.baseline_m,
        tilt_rad: args.tilt_deg.to_radians(),
        toe_in_rad: args.toe_in_deg.to_radians(),
        focal_px,
        image_px: args.image,
    })
}

fn written(path: &Path, text: &str) -> anyhow::Result<()> {
    let place = path.display();
    std::fs::write(path, text).with_context(|| format!("cannot write {place}"))?;
    eprintln!("written to {place}");
    Ok(())
}

fn say(report: &Report) {
    let [across, down] = report.cameras[0].field_deg;
    println!("field of view     {across:.1} x {down:.1} degrees");
    for coverage in &report.coverage {
        let [left, right, both] = coverage.far_half_singles.map(|part| part * 100.0);
        let [_, _, doubles] = coverage.far_half_doubles.map(|part| part * 100.0);
        println!(
            "far half, {:.0} m up   singles: left {left:.0} %, right {right:.0} %, both {both:.0} \
             %; doubles: both {doubles:.0} %",
            coverage.height_m
        );
    }
    for place in &report.places {
        let [left, right] =
            place.ball_px.map(|px| px.map_or("-".to_owned(), |px| format!("{px:.1}")));
        println!("ball              {left} px in left, {right} px in right: {}", place.name);
    }
    println!("bounce at 21.6 m  {}", words_of(&report.far_shot));
    if let (Some(median), Some(worst)) = (report.median, report.worst) {
        println!(
            "all that is seen  median {:.2} cm along, {:.2} across; largest {:.2} and {:.2} cm",
            median.along_m * 100.0,
            median.across_m * 100.0,
            worst.along_m * 100.0,
            worst.across_m * 100.0
        );
    }
}

fn words_of(cell: &CellView) -> String {
    let Some(sigma) = cell.sigma else { return cell.outcome.to_owned() };
    let part = |name: &str, of: Option<fusion::calibration::siting::report::SigmaView>| {
        of.map_or(String::new(), |sigma| {
            let [along, across] = [sigma.along_m, sigma.across_m].map(|m| m * 100.0);
            format!("; {name} {along:.2} and {across:.2}")
        })
    };
    format!(
        "{:.2} cm along, {:.2} cm across{}{}",
        sigma.along_m * 100.0,
        sigma.across_m * 100.0,
        part("by noise alone", cell.by_noise),
        part("by calibration", cell.by_calibration)
    )
}
