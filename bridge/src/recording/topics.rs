//! What a recording holds: names of topics, how their messages are encoded, and what says so.
//!
//! ```text
//! /left/candidates, /left/frames-info   batches of one message, as on the network (wire::batch)
//! /left/annotations                     a circle for each candidate, frame by frame
//! /left/image                           pixels (on a board, if asked for)
//! /shots                                "shots/1", one shot a message
//! /scene                                the court and the last shot's flight
//! /clock                                how each board's link and clock are
//! /corrections                          "correction/1": what to tell the machine next, and why
//! /launcher/commands, /launcher/answers "launcher-command/1", "launcher-answer/1"
//! ```
//! and the same for `/right`. Attached is `rig.toml`, if it was given.

use crate::wire::Stream;
use crate::wire::VERSION;
use foxglove::messages::{ImageAnnotations, RawImage, SceneUpdate};
use shm_layout::Camera;
use std::borrow::Cow;

/// How our own messages are encoded; "x-" is MCAP's mark of what only some know.
pub const OWN_ENCODING: &str = "x-tennis-wire";

/// The name under which a rig is attached.
pub const RIG_FILE: &str = "rig.toml";

/// The metadata that stand at the front, and those at the end.
pub const BEGUN: &str = "recording";
/// See [`BEGUN`].
pub const ENDED: &str = "recording-end";

/// One topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Topic {
    /// What a board sends, as it was read.
    Board(Camera, Stream),
    /// Circles around candidates.
    Annotations(Camera),
    /// Pixels.
    Image(Camera),
    /// Shots as JSON.
    Shots,
    /// The last shot, drawn.
    Scene,
    /// Clocks and links.
    Clock,
    /// What fusion says to the machine, as JSON.
    Corrections,
    /// What the machine's launcher is told, as JSON.
    LauncherCommands,
    /// What it answers, as JSON.
    LauncherAnswers,
}

/// What says how the messages of a topic are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// Of the message.
    pub name: String,
    /// Of `data`.
    pub encoding: String,
    /// The definition itself.
    pub data: Cow<'static, [u8]>,
    /// Of the messages.
    pub message_encoding: String,
}

impl Topic {
    /// Its name in the file.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Board(camera, stream) => format!("/{camera}/{}", stream.name()),
            Self::Annotations(camera) => format!("/{camera}/annotations"),
            Self::Image(camera) => format!("/{camera}/image"),
            Self::Shots => "/shots".to_owned(),
            Self::Scene => "/scene".to_owned(),
            Self::Clock => "/clock".to_owned(),
            Self::Corrections => "/corrections".to_owned(),
            Self::LauncherCommands => "/launcher/commands".to_owned(),
            Self::LauncherAnswers => "/launcher/answers".to_owned(),
        }
    }

    /// The topic of this name, if a replay or a reader of ours needs it.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let of_board = |camera| Stream::ALL.map(|stream| Self::Board(camera, stream));
        let [left, right] = Camera::BOTH.map(of_board);
        left.into_iter().chain(right).chain([Self::Shots]).find(|topic| topic.name() == name)
    }

    /// How its messages are read.
    #[must_use]
    pub fn schema(self) -> Schema {
        match self {
            Self::Board(_, Stream::FramesInfo) => own("tennis.FrameInfo"),
            Self::Board(_, Stream::Candidates) => own("tennis.StripCandidates"),
            Self::Annotations(_) => drawn::<ImageAnnotations>(),
            Self::Image(_) => drawn::<RawImage>(),
            Self::Scene => drawn::<SceneUpdate>(),
            Self::Shots => json("tennis.Shot", include_bytes!("schemas/shot.json")),
            Self::Clock => json("tennis.Link", include_bytes!("schemas/link.json")),
            Self::Corrections => {
                json("tennis.Correction", include_bytes!("schemas/correction.json"))
            }
            Self::LauncherCommands => {
                json("tennis.LauncherCommand", include_bytes!("schemas/launcher-command.json"))
            }
            Self::LauncherAnswers => {
                json("tennis.LauncherAnswer", include_bytes!("schemas/launcher-answer.json"))
            }
        }
    }
}

fn own(name: &str) -> Schema {
    let data = format!("version {VERSION} of bridge/src/wire/batch.rs, one message a batch");
    let (name, data) = (name.to_owned(), Cow::Owned(data.into_bytes()));
    Schema {
        name,
        encoding: OWN_ENCODING.to_owned(),
        data,
        message_encoding: OWN_ENCODING.to_owned(),
    }
}

fn json(name: &str, data: &'static [u8]) -> Schema {
    Schema {
        name: name.to_owned(),
        encoding: "jsonschema".to_owned(),
        data: Cow::Borrowed(data),
        message_encoding: "json".to_owned(),
    }
}

fn drawn<T: foxglove::Encode>() -> Schema {
    let schema = T::get_schema().expect("all of Foxglove's messages have a schema");
    let foxglove::Schema { name, encoding, data } = schema;
    Schema { name, encoding, data, message_encoding: T::get_message_encoding() }
}

/// The bytes of a message for viewers.
#[must_use]
pub fn bytes_from(message: &impl foxglove::Encode) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(message.encoded_len().unwrap_or_default());
    // A vector grows as it is written, which is all that could fail.
    drop(message.encode(&mut bytes));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_replay_needs_is_found_by_its_name() {
        for camera in Camera::BOTH {
            for stream in Stream::ALL {
                let topic = Topic::Board(camera, stream);
                assert_eq!(Topic::from_name(&topic.name()), Some(topic));
            }
        }
        assert_eq!(Topic::from_name("/shots"), Some(Topic::Shots));
        assert_eq!(Topic::from_name("/left/image"), None);
    }

    #[test]
    fn json_schemas_are_objects_with_properties() {
        for (topic, more_than) in [
            (Topic::Shots, 5),
            (Topic::Clock, 5),
            (Topic::Corrections, 5),
            (Topic::LauncherCommands, 4),
            (Topic::LauncherAnswers, 5),
        ] {
            let schema = topic.schema();
            let value: serde_json::Value = serde_json::from_slice(&schema.data).unwrap();
            assert_eq!(value["type"], "object");
            assert!(value["properties"].as_object().unwrap().len() > more_than, "{topic:?}");
        }
    }

    #[test]
    fn drawn_messages_are_those_viewers_know() {
        let names = [Topic::Annotations(Camera::Left), Topic::Image(Camera::Left), Topic::Scene]
            .map(|topic| topic.schema().name);
        assert_eq!(
            names,
            ["foxglove.ImageAnnotations", "foxglove.RawImage", "foxglove.SceneUpdate"]
        );
    }
}
