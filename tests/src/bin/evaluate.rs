//! `evaluate`: how well and how fast balls are found in a labelled clip, by each method.

use anyhow::{Context as _, ensure};
use capture::recording::Recording;
use clap::Parser;
use page::labels::{self, Labels};
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use tests::evaluation::{self, Evaluation, Score};
use tests::overlay::{Overlay, Still};
use workers::Settings;
use workers::method::{self, Method};

/// Most bytes of a clip held in memory, so that every method sees the same.
const MAX_CLIP_BYTES: usize = 4 << 30;

/// The thesis' Table 1 for a clip: true positives, false candidates, centroid, time.
#[derive(Debug, Parser)]
#[command(version)]
struct Flags {
    /// A YUV4MPEG2 file, mono or 4:2:0.
    video: PathBuf,
    /// Where the ball is: frame,x_px,y_px[,hard].
    truth: PathBuf,
    /// Names of methods with commas between, or all.
    #[arg(long, default_value = "all")]
    methods: String,
    /// Where the table goes as JSON; - is stdout, in place of the text.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Frames shown first, to learn the background from, such as 121..164.
    #[arg(long, value_name = "FROM..TO", value_parser = range_from_text)]
    learn: Option<Range<usize>>,
    /// A pixel is new if it did not stand out this many frames ago; default: what suits the method.
    #[arg(long)]
    look_back_frames: Option<usize>,
    /// The clip with red crosses on candidates and a blue circle on the label, one method only.
    #[arg(long, value_name = "FILE.y4m")]
    video_out: Option<PathBuf>,
    /// All frames in one picture, candidates marked, one method only.
    #[arg(long, value_name = "FILE.png")]
    still_out: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let flags = Flags::parse();
    let methods = methods_from_text(&flags.methods)?;
    ensure!(
        methods.len() == 1 || (flags.video_out.is_none() && flags.still_out.is_none()),
        "--video-out and --still-out show one method: name it with --methods"
    );
    let clip = Clip::open(&flags.video)?;
    let truth = File::open(&flags.truth).with_context(|| flags.truth.display().to_string())?;
    let labels = labels::from_csv(truth).with_context(|| flags.truth.display().to_string())?;
    if let Some(last) = labels.keys().last() {
        let n_frames = clip.frames.len();
        ensure!(*last < n_frames, "a label for frame {last}, the clip has {n_frames}");
    }
    let mut scores = Vec::new();
    for method in methods {
        eprintln!("{} …", method.name);
        scores.push(evaluated(&flags, method, &clip, &labels)?);
    }
    match &flags.json {
        Some(path) if path.as_os_str() == "-" => println!("{}", json_from(&flags, &clip, &scores)),
        Some(path) => {
            std::fs::write(path, json_from(&flags, &clip, &scores) + "\n")
                .with_context(|| path.display().to_string())?;
            print!("{}", evaluation::text_from(&scores));
        }
        None => print!("{}", evaluation::text_from(&scores)),
    }
    Ok(())
}

fn evaluated(flags: &Flags, method: Method, clip: &Clip, labels: &Labels) -> anyhow::Result<Score> {
    let name = method.name;
    let settings = Settings { method, look_back: flags.look_back_frames, ..Settings::DEFAULT };
    let mut evaluation = Evaluation::new(clip.size_px, &settings);
    if let Some(range) = &flags.learn {
        let frames = clip.frames.get(range.clone()).with_context(|| {
            format!("--learn {range:?}: the clip has {} frames", clip.frames.len())
        })?;
        frames.iter().for_each(|luma| evaluation.learn(luma));
    }
    let mut video = match &flags.video_out {
        Some(path) => {
            let file = File::create(path).with_context(|| path.display().to_string())?;
            let mut video = BufWriter::new(file);
            Overlay::new(clip.size_px, &clip.frames[0]).write_y4m_header(&mut video)?;
            Some(video)
        }
        None => None,
    };
    let (mut still, mut found) = (Still::default(), Vec::new());
    for (frame_idx, luma) in clip.frames.iter().enumerate() {
        let candidates = evaluation.update(frame_idx, luma, labels);
        if let Some(video) = &mut video {
            let mut overlay = Overlay::new(clip.size_px, luma);
            overlay.draw_candidates(&candidates);
            labels.get(&frame_idx).iter().for_each(|label| overlay.draw_label(label));
            overlay.write_y4m_frame(&mut *video)?;
        }
        if flags.still_out.is_some() {
            still.update(luma);
            found.extend(candidates);
        }
    }
    if let Some(mut video) = video {
        video.flush()?;
    }
    if let Some(path) = &flags.still_out {
        let mut overlay = Overlay::new(clip.size_px, still.luma());
        overlay.draw_candidates(&found);
        overlay.to_image().save(path).with_context(|| path.display().to_string())?;
    }
    Ok(evaluation.score(name))
}

fn json_from(flags: &Flags, clip: &Clip, scores: &[Score]) -> String {
    let document = serde_json::json!({
        "video": flags.video.display().to_string(),
        "frames": clip.frames.len(),
        "look_back_frames": flags.look_back_frames,
        "methods": scores,
    });
    format!("{document:#}")
}

/// A clip in memory.
struct Clip {
    size_px: (u32, u32),
    frames: Vec<Vec<u8>>,
}

impl Clip {
    fn open(path: &Path) -> anyhow::Result<Self> {
        let mut recording = Recording::open(path)?;
        let size_px = recording.size_px();
        let n_bytes = size_px.0 as usize * size_px.1 as usize;
        let n_frames = recording.n_frames();
        ensure!(
            n_frames.saturating_mul(n_bytes) <= MAX_CLIP_BYTES,
            "{}: {n_frames} frames are more than fit in memory; cut the clip",
            path.display()
        );
        let mut frames = Vec::with_capacity(n_frames);
        for _ in 0..n_frames {
            let mut luma = vec![0; n_bytes];
            recording.read_into(&mut luma)?;
            frames.push(luma);
        }
        Ok(Self { size_px, frames })
    }
}

fn methods_from_text(text: &str) -> anyhow::Result<Vec<Method>> {
    if text == "all" {
        return Ok(method::all());
    }
    text.split(',').map(|name| Method::from_name(name).map_err(anyhow::Error::msg)).collect()
}

fn range_from_text(text: &str) -> Result<Range<usize>, String> {
    let range = text
        .split_once("..")
        .and_then(|(from, to)| Some(from.parse::<usize>().ok()?..to.parse::<usize>().ok()?));
    range.filter(|r| r.start < r.end).ok_or_else(|| format!("expected FROM..TO, got {text:?}"))
}
