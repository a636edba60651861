//! Things that were read → a file.
//!
//! A chunk is built in memory and handed to the system whole, with everything before it. Without
//! compression: pixels of a noisy sensor shrink by little, and a board has no time to spare.

use super::annotations::Annotations;
use super::queue::{Item, LeftOut};
use super::scene;
use super::times::{Times, timestamp_from};
use super::topics::{BEGUN, ENDED, RIG_FILE, Topic, bytes_from};
use crate::wire::Stream;
use crate::wire::VERSION;
use crate::wire::batch::{Batch, Message, bytes_from_batch};
use foxglove::bytes::Bytes;
use foxglove::messages::RawImage;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapResult, WriteOptions};
use serde_json::json;
use shm_layout::stamp::OWN_CLOCK;
use shm_layout::{Camera, FrameInfo, Link, StampNs};
use std::collections::{BTreeMap, HashMap};
use std::io::{Seek, Write};
use std::sync::atomic::Ordering;

/// A chunk is closed when it is this large, too: of pixels, seven a second.
const MAX_CHUNK_BYTES: u64 = 4 << 20;

/// What was written, by topic.
pub type Counts = BTreeMap<String, u64>;

#[derive(Debug, Clone, Copy)]
struct Channel {
    id: u16,
    n_messages: u32,
}

/// A recording that grows.
pub struct Writer<W: Write + Seek> {
    file: mcap::Writer<W>,
    times: Times,
    channels: HashMap<Topic, Channel>,
    annotations: [Annotations; 2],
    cameras_m: Vec<[f64; 3]>,
}

impl<W: Write + Seek> Writer<W> {
    /// Begins a recording: what is known of it, the rig if there is one, and the empty court.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn begin(
        file: W,
        times: Times,
        now_ns: StampNs,
        about: BTreeMap<String, String>,
        rig_toml: Option<&str>,
    ) -> McapResult<Self> {
        let file = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(MAX_CHUNK_BYTES))
            .disable_seeking(true) // a chunk is written when it is whole
            .library(format!("record {}", env!("CARGO_PKG_VERSION")))
            .create(file)?;
        let cameras_m = rig_toml.map_or(Vec::new(), scene::cameras_in_court_m);
        let channels = HashMap::new();
        let annotations = Default::default();
        let mut writer = Self { file, times, channels, annotations, cameras_m };
        let mut about = about;
        about.insert("wire_version".to_owned(), VERSION.to_string());
        about.insert("day_minus_stamp_ns".to_owned(), times.day_minus_stamp_ns.to_string());
        let metadata = Metadata { name: BEGUN.to_owned(), metadata: about };
        writer.file.write_metadata(&metadata)?;
        if let Some(rig_toml) = rig_toml {
            let day_ns = times.day_ns(now_ns);
            writer.file.attach(&Attachment {
                log_time: day_ns,
                create_time: day_ns,
                name: RIG_FILE.to_owned(),
                media_type: "application/toml".to_owned(),
                data: rig_toml.as_bytes().into(),
            })?;
        }
        writer.put_scene(now_ns, None)?;
        writer.flush()?;
        Ok(writer)
    }

    /// Writes what was read at this time.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn put(&mut self, read_ns: StampNs, item: &Item) -> McapResult<()> {
        match item {
            Item::Message(message) => self.put_message(read_ns, message),
            Item::Frame(info, luma) => self.put_frame(read_ns, info, luma),
            Item::Shot(text) => {
                let day_ns = self.times.day_ns(read_ns);
                self.publish(Topic::Shots, [day_ns; 2], text.as_bytes())?;
                self.put_scene(read_ns, Some(text))
            }
            Item::Machine(topic, text) => {
                let day_ns = self.times.day_ns(read_ns);
                self.publish(*topic, [day_ns; 2], text.as_bytes())
            }
            Item::Link(link) => {
                let times = [self.times.day_ns(read_ns), self.times.day_ns(link.noted_ns)];
                self.publish(Topic::Clock, times, json_from(link).as_bytes())
            }
        }
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn flush(&mut self) -> McapResult<()> {
        self.file.flush()
    }

    /// Ends the recording with what was left out of it, and its index.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(mut self, left_out: &LeftOut) -> McapResult<Counts> {
        let metadata = BTreeMap::from([
            ("messages_left_out", left_out.n_messages.load(Ordering::Relaxed)),
            ("frames_left_out", left_out.n_frames.load(Ordering::Relaxed)),
            ("frames_missed", left_out.n_frames_missed.load(Ordering::Relaxed)),
        ]);
        let metadata = metadata.into_iter().map(|(name, n)| (name.to_owned(), n.to_string()));
        let metadata = Metadata { name: ENDED.to_owned(), metadata: metadata.collect() };
        self.file.write_metadata(&metadata)?;
        self.file.finish()?;
        let counts = self.counts();
        self.file.into_inner().flush()?;
        Ok(counts)
    }

    fn counts(&self) -> Counts {
        self.channels.iter().map(|(topic, c)| (topic.name(), c.n_messages.into())).collect()
    }

    fn put_message(&mut self, read_ns: StampNs, message: &Message) -> McapResult<()> {
        let (stream, camera_idx, exposed_ns, clock_sigma_ns) = match message {
            Message::FrameInfo(info) => {
                (Stream::FramesInfo, info.camera_idx, info.exposed_ns, info.clock_sigma_ns)
            }
            Message::Candidates(strip) => {
                (Stream::Candidates, strip.camera_idx, strip.exposed_ns, strip.clock_sigma_ns)
            }
        };
        // Who else writes there is none of ours, and nobody reads what it writes.
        let Some(camera) = Camera::from_idx(camera_idx) else { return Ok(()) };
        let topic = Topic::Board(camera, stream);
        let batch_idx = self.channels.get(&topic).map_or(0, |channel| channel.n_messages.into());
        let batch = Batch { session_id: 0, batch_idx, messages: vec![message.clone()] };
        let times = self.log_and_exposed(read_ns, exposed_ns, clock_sigma_ns);
        self.publish(topic, times, &bytes_from_batch(&batch))?;
        if let Message::Candidates(strip) = message {
            let drawn = self.annotations[camera.idx()].update(strip, self.times);
            for annotations in drawn {
                self.publish(Topic::Annotations(camera), times, &bytes_from(&annotations))?;
            }
        }
        Ok(())
    }

    fn put_frame(&mut self, read_ns: StampNs, info: &FrameInfo, luma: &[u8]) -> McapResult<()> {
        let Some(camera) = Camera::from_idx(info.camera_idx) else { return Ok(()) };
        let day_ns = self.times.exposed_day_ns(info.exposed_ns, info.clock_sigma_ns);
        let image = RawImage {
            timestamp: Some(timestamp_from(day_ns)),
            frame_id: camera.name().to_owned(),
            width: info.width_px,
            height: info.height_px,
            encoding: "mono8".to_owned(),
            step: info.width_px,
            data: Bytes::copy_from_slice(luma),
        };
        let times = self.log_and_exposed(read_ns, info.exposed_ns, info.clock_sigma_ns);
        self.publish(Topic::Image(camera), times, &bytes_from(&image))
    }

    fn put_scene(&mut self, read_ns: StampNs, shot: Option<&str>) -> McapResult<()> {
        let day_ns = self.times.day_ns(read_ns);
        let scene = scene::from_shot(shot, &self.cameras_m, day_ns);
        self.publish(Topic::Scene, [day_ns; 2], &bytes_from(&scene))
    }

    /// When it was read, and when it was exposed: on a clock of a file's own the same.
    fn log_and_exposed(&self, read_ns: StampNs, exposed_ns: StampNs, sigma_ns: u32) -> [u64; 2] {
        let seen_ns = if sigma_ns == OWN_CLOCK { read_ns } else { exposed_ns };
        [self.times.day_ns(read_ns), self.times.day_ns(seen_ns)]
    }

    fn publish(
        &mut self,
        topic: Topic,
        [log_time, publish_time]: [u64; 2],
        data: &[u8],
    ) -> McapResult<()> {
        let mut channel = match self.channels.get(&topic) {
            Some(channel) => *channel,
            None => self.new_channel(topic)?,
        };
        let (channel_id, sequence) = (channel.id, channel.n_messages);
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        self.file.write_to_known_channel(&header, data)?;
        channel.n_messages = channel.n_messages.wrapping_add(1);
        self.channels.insert(topic, channel);
        Ok(())
    }

    fn new_channel(&mut self, topic: Topic) -> McapResult<Channel> {
        let schema = topic.schema();
        let schema_id = self.file.add_schema(&schema.name, &schema.encoding, &schema.data)?;
        let (name, encoding) = (topic.name(), schema.message_encoding);
        let id = self.file.add_channel(schema_id, &name, &encoding, &BTreeMap::new())?;
        Ok(Channel { id, n_messages: 0 })
    }
}

fn json_from(link: &Link) -> String {
    let camera = Camera::from_idx(link.camera_idx).map_or("", Camera::name);
    let sigma_ns = Some(link.clock_sigma_ns).filter(|sigma_ns| *sigma_ns != OWN_CLOCK);
    json!({
        "camera": camera,
        "is_alive": link.is_alive != 0,
        "noted_ns": link.noted_ns,
        "board_minus_here_ns": link.board_minus_here_ns,
        "sigma_ns": sigma_ns,
        "rate_ppm": link.rate * 1e6,
        "round_trip_ns": link.round_trip_ns,
        "n_batches": link.n_batches,
        "n_filled": link.n_filled,
        "n_lost": link.n_lost,
        "n_refused": link.n_refused,
    })
    .to_string()
}
