//! The same frames to two readers through shared memory, a pipe and a Unix socket -> how long each
//! takes from being sent to being there. Readers are processes of their own.
//!
//! A stamp is taken before a frame is sent to the first reader; filling it is not counted in any
//! way. Through a pipe or a socket a frame is there when its last byte is.

use crate::link::latency::Latency;
use crate::processes;
use anyhow::{Context as _, ensure};
use clap::ValueEnum;
use serde::Serialize;
use shm_layout::services::{Domain, Place};
use shm_layout::stamp::now_ns;
use shm_layout::stop::Stop;
use shm_layout::{Camera, FrameInfo};
use std::io::{BufRead as _, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

/// Readers of every frame.
const N_READERS: usize = 2;
/// Sizes and ways take turns: a machine that becomes faster or slower favours none of them.
const N_ROUNDS: usize = 5;
/// What is sent before a pipe's or a socket's frame: the stamp and the number of bytes.
const HEADER_BYTES: usize = 16;
/// A pipe's buffer, the most that Linux gives without asking.
const PIPE_BYTES: usize = 1 << 20;
/// Who starts must read by then.
const READY_WITHIN: Duration = Duration::from_secs(10);

/// How frames go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// As capture publishes them.
    SharedMemory,
    /// A pipe to each reader.
    Pipe,
    /// A Unix socket to each reader.
    UnixSocket,
}

/// One line of the comparison.
#[derive(Debug, Clone, Serialize)]
pub struct Sent {
    /// How.
    pub way: Way,
    /// Pixels of a frame.
    pub size_px: [usize; 2],
    /// From the stamp to each reader.
    pub took: Latency,
}

/// Sends `n_frames` of each size in each way, `fps` a second.
///
/// # Errors
/// When a reader cannot be started or loses a frame.
pub fn compare(
    sizes_px: &[[usize; 2]],
    fps: f64,
    n_frames: usize,
    stop: &Stop,
) -> anyhow::Result<Vec<Sent>> {
    let ways = [Way::SharedMemory, Way::Pipe, Way::UnixSocket];
    let mut took_ns: Vec<([usize; 2], Way, Vec<i64>)> = Vec::new();
    for &size_px in sizes_px {
        took_ns.extend(ways.map(|way| (size_px, way, Vec::new())));
    }
    for round in 0..N_ROUNDS {
        let n_frames = n_frames * (round + 1) / N_ROUNDS - n_frames * round / N_ROUNDS;
        if n_frames == 0 {
            continue;
        }
        for (size_px, way, all_ns) in &mut took_ns {
            ensure!(!stop.is_raised(), processes::Error::Stopped);
            let round_ns = sent(*way, *size_px, fps, n_frames)?;
            let (n_read, n_sent) = (round_ns.len(), n_frames * N_READERS);
            ensure!(n_read == n_sent, "{way:?}: {n_read} of {n_sent} frames were read");
            all_ns.extend(round_ns);
        }
    }
    let line = |(size_px, way, all_ns)| Sent { way, size_px, took: Latency::from_ns(all_ns) };
    Ok(took_ns.into_iter().map(line).collect())
}

/// Who reads, and what it prints in the end.
struct Reader {
    child: Child,
    words: BufReader<ChildStdout>,
}

impl Reader {
    fn start(way: Way, place: &str, n_frames: usize, stdin: Stdio) -> anyhow::Result<Self> {
        let mut command = Command::new(std::env::current_exe().context("the running binary")?);
        let way = way.to_possible_value().context("every way has a name")?;
        command.args(["--read", way.get_name(), "--read-from", place]);
        command.args(["--frames", &n_frames.to_string(), "--with-parent"]);
        let mut child =
            command.stdin(stdin).stdout(Stdio::piped()).spawn().context("start a reader")?;
        let words = BufReader::new(child.stdout.take().context("a reader's words")?);
        Ok(Self { child, words })
    }

    /// Waits for its first line, which says that it reads.
    fn is_ready(&mut self) -> anyhow::Result<()> {
        let mut line = String::new();
        self.words.read_line(&mut line).context("a reader's first line")?;
        ensure!(line.trim() == "ready", "a reader says {line:?}, expected ready");
        Ok(())
    }

    fn times_ns(mut self) -> anyhow::Result<Vec<i64>> {
        let mut text = String::new();
        self.words.read_to_string(&mut text).context("a reader's times")?;
        ensure!(self.child.wait().context("wait for a reader")?.success(), "a reader failed");
        text.lines().map(|line| line.parse().context("a reader's time")).collect()
    }
}

fn sent(way: Way, size_px: [usize; 2], fps: f64, n_frames: usize) -> anyhow::Result<Vec<i64>> {
    let luma: Vec<u8> = (0..size_px[0] * size_px[1]).map(|i| (i * 31 % 251) as u8).collect();
    let period = Duration::from_secs_f64(1.0 / fps);
    match way {
        Way::SharedMemory => through_memory(size_px, &luma, period, n_frames),
        Way::Pipe | Way::UnixSocket => through_bytes(way, &luma, period, n_frames),
    }
}

fn through_memory(
    [width, height]: [usize; 2],
    luma: &[u8],
    period: Duration,
    n_frames: usize,
) -> anyhow::Result<Vec<i64>> {
    let court = processes::own_court("transport")?;
    let domain = Domain::new(&court, Place::Board(Camera::Left))?;
    let member = domain.join("sender")?;
    let frames = member.frames()?;
    let writer = frames.writer(luma.len())?;
    let mut readers = Vec::new();
    for _ in 0..N_READERS {
        readers.push(Reader::start(Way::SharedMemory, &court, n_frames, Stdio::null())?);
    }
    readers.iter_mut().try_for_each(Reader::is_ready)?;
    let begun = Instant::now();
    for idx in 0..n_frames {
        let mut loan = writer.loan(luma.len())?;
        loan.payload_mut().copy_from_slice(luma);
        sleep_until(begun + period * idx as u32);
        let info = FrameInfo {
            frame_idx: idx as u64,
            published_ns: now_ns(),
            width_px: width as u32,
            height_px: height as u32,
            ..FrameInfo::default()
        };
        writer.send(loan, info)?;
    }
    let times: anyhow::Result<Vec<Vec<i64>>> = readers.into_iter().map(Reader::times_ns).collect();
    let times = times?;
    drop((writer, frames, member));
    domain.close()?;
    Ok(times.concat())
}

fn through_bytes(
    way: Way,
    luma: &[u8],
    period: Duration,
    n_frames: usize,
) -> anyhow::Result<Vec<i64>> {
    let folder = tempfile::tempdir().context("a folder for a socket")?;
    let path = folder.path().join("frames");
    let listener = UnixListener::bind(&path).context("listen on a Unix socket")?;
    let mut readers = Vec::new();
    let mut ends: Vec<Box<dyn Write>> = Vec::new();
    for _ in 0..N_READERS {
        if way == Way::Pipe {
            let (read, write) = std::io::pipe().context("make a pipe")?;
            rustix::pipe::fcntl_setpipe_size(&write, PIPE_BYTES).context("widen a pipe")?;
            readers.push(Reader::start(way, "-", n_frames, read.into())?);
            ends.push(Box::new(write));
        } else {
            let place = path.to_string_lossy();
            readers.push(Reader::start(way, &place, n_frames, Stdio::null())?);
            ends.push(Box::new(listener.accept().context("a reader's connection")?.0));
        }
    }
    readers.iter_mut().try_for_each(Reader::is_ready)?;
    let begun = Instant::now();
    for idx in 0..n_frames {
        sleep_until(begun + period * idx as u32);
        let stamp_ns = now_ns();
        for end in &mut ends {
            let mut header = [0; HEADER_BYTES];
            header[..8].copy_from_slice(&stamp_ns.to_le_bytes());
            header[8..].copy_from_slice(&(luma.len() as u64).to_le_bytes());
            end.write_all(&header).context("send a header")?;
            end.write_all(luma).context("send a frame")?;
        }
    }
    drop(ends);
    let times: anyhow::Result<Vec<Vec<i64>>> = readers.into_iter().map(Reader::times_ns).collect();
    Ok(times?.concat())
}

fn sleep_until(due: Instant) {
    std::thread::sleep(due.saturating_duration_since(Instant::now()));
}

/// What a reader does: reads `n_frames` and prints how long each was under way, ns.
///
/// # Errors
/// When what it reads from ends early.
pub fn read(way: Way, place: &str, n_frames: usize, stop: &Stop) -> anyhow::Result<()> {
    let times_ns = match way {
        Way::SharedMemory => from_memory(place, n_frames, stop)?,
        Way::Pipe => from_bytes(std::io::stdin().lock(), n_frames)?,
        Way::UnixSocket => {
            from_bytes(UnixStream::connect(Path::new(place)).context("connect")?, n_frames)?
        }
    };
    let lines: Vec<String> = times_ns.iter().map(i64::to_string).collect();
    println!("{}", lines.join("\n"));
    Ok(())
}

fn from_memory(court: &str, n_frames: usize, stop: &Stop) -> anyhow::Result<Vec<i64>> {
    let member = Domain::new(court, Place::Board(Camera::Left))?.join("reader")?;
    let frames = member.frames()?;
    let (reader, alarm) = (frames.reader()?, frames.alarm()?);
    println!("ready");
    let mut times_ns = Vec::with_capacity(n_frames);
    let mut heard_at = Instant::now();
    while times_ns.len() < n_frames && !stop.is_raised() && heard_at.elapsed() < READY_WITHIN {
        while let Some(frame) = reader.receive()? {
            times_ns.push(now_ns() - frame.user_header().published_ns);
            heard_at = Instant::now();
        }
        alarm.wait()?;
    }
    Ok(times_ns)
}

fn from_bytes(mut from: impl Read, n_frames: usize) -> anyhow::Result<Vec<i64>> {
    println!("ready");
    let mut times_ns = Vec::with_capacity(n_frames);
    let (mut header, mut luma) = ([0; HEADER_BYTES], Vec::new());
    while times_ns.len() < n_frames {
        from.read_exact(&mut header).context("read a header")?;
        let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        luma.resize(usize::try_from(number(8))?, 0);
        from.read_exact(&mut luma).context("read a frame")?;
        times_ns.push(now_ns() - number(0) as i64);
    }
    Ok(times_ns)
}
