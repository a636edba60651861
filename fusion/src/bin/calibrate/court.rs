use anyhow::Context as _;
use fusion::Rig;
use fusion::calibration::court;
use fusion::calibration::picture::Picture;
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct Args {
    #[arg(long)]
    left: PathBuf,
    #[arg(long)]
    right: PathBuf,
    #[arg(long)]
    rig: PathBuf,
}

pub fn picture(path: &Path) -> anyhow::Result<Picture> {
    let image = image::open(path).with_context(|| path.display().to_string())?;
    let image = image.to_luma32f();
    let luma = image.as_raw().iter().map(|v| v * 255.0).collect();
    Ok(Picture::new(image.width() as usize, image.height() as usize, luma))
}

pub fn run(args: &Args) -> anyhow::Result<()> {
    let text = std::fs::read_to_string(&args.rig)?;
    let rig = Rig::from_file_text(&args.rig.display().to_string(), &text)?;
    let pictures = [picture(&args.left)?, picture(&args.right)?];
    let t = std::time::Instant::now();
    let found = court::from_pictures(pictures.each_ref(), &rig, &court::Settings::default())?;
    println!("{:?}", t.elapsed());
    let step = rig.step_to(&found.fitted.rig);
    let cov = found.fitted.rig.covariance().unwrap();
    for i in 0..30 {
        println!(
            "{:20} {:+.3e} +- {:.3e}",
            fusion::world::adjustment::name_of(i),
            step[i],
            cov[(i, i)].sqrt()
        );
    }
    println!(
        "rms {:?} noise {:?} blur {:?}",
        found.fitted.rms_px, found.fitted.noise, found.blur_px
    );
    for (i, l) in found.lines.iter().enumerate() {
        let n = [0, 1].map(|c| found.pieces[c].iter().filter(|p| p.line_idx == i).count());
        let ne = [0, 1].map(|c| {
            found.pieces[c]
                .iter()
                .zip(&found.fitted.is_explained[c])
                .filter(|(p, e)| p.line_idx == i && **e)
                .count()
        });
        let k = [0, 1].map(|c| {
            let v: Vec<f64> =
                found.pieces[c].iter().filter(|p| p.line_idx == i).map(|p| p.contrast).collect();
            v.iter().sum::<f64>() / v.len().max(1) as f64
        });
        println!(
            "{:25} paint {:.4?} pieces {:?} explained {:?} contrast {:.1?}",
            l.name, found.fitted.paint_m[i], n, ne, k
        );
    }
    Ok(())
}
