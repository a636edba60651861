//! temporary
use capture::recording::Recording;
use shm_layout::FrameInfo;
use std::fs::File;
use tests::labels;
use workers::strip::Strip;
use workers::{Settings, Worker};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let mut recording = Recording::open(std::path::Path::new(&args[1])).unwrap();
    let labels = labels::from_csv(File::open(&args[2]).unwrap()).unwrap();
    let learn: Option<(usize, usize)> = args.get(3).map(|t| {
        let (a, b) = t.split_once("..").unwrap();
        (a.parse().unwrap(), b.parse().unwrap())
    });
    let size = recording.size_px();
    let n = recording.n_frames();
    let frames: Vec<Vec<u8>> = (0..n)
        .map(|_| {
            let mut l = vec![0; (size.0 * size.1) as usize];
            recording.read_into(&mut l).unwrap();
            l
        })
        .collect();
    let mut worker = Worker::new(Strip::new(0, 1, size), &Settings::DEFAULT);
    let mut k = 0;
    if let Some((a, b)) = learn {
        for f in &frames[a..b] {
            worker.update(&FrameInfo { frame_idx: k, ..FrameInfo::default() }, f);
            k += 1;
        }
    }
    println!("frame,lx,ly,hard,dx,dy,x,y,xx,xy,yy,w,h,area,diam,contrast,sx,sy,snr");
    for (i, f) in frames.iter().enumerate() {
        let m = worker.update(&FrameInfo { frame_idx: k, ..FrameInfo::default() }, f);
        k += 1;
        let l = labels.get(&i);
        let mut found = false;
        for c in m.spots() {
            let (lx, ly) = l.map_or((f64::NAN, f64::NAN), |l| (l.x_px, l.y_px));
            let (dx, dy) = (f64::from(c.x_px) - lx, f64::from(c.y_px) - ly);
            let near = dx.hypot(dy) <= 5.0;
            found |= near;
            let a: Vec<String> = c.to_array().iter().map(|v| format!("{v:.3}")).collect();
            println!(
                "{i},{lx:.2},{ly:.2},{},{dx:.3},{dy:.3},{}",
                if near { "ball" } else { "false" },
                a.join(",")
            );
        }
        if let Some(l) = l {
            if !found {
                println!(
                    "{i},{:.2},{:.2},{}",
                    l.x_px,
                    l.y_px,
                    if l.is_hard {
                        "hard-miss"
                    } else if m.is_learning != 0 {
                        "learn-miss"
                    } else {
                        "miss"
                    }
                );
            }
        }
    }
}
