//! YAML text -> numbers, with the file and the key in every refusal.
//!
//! Written for calibration files: a map of numbers, lists and matrices. OpenCV's first line
//! (`%YAML:1.0`, which no YAML parser takes) and its tag `!!opencv-matrix` are understood. Limits:
//! a megabyte of text, and the parser's own on depth, nodes and aliases.

use super::Refused;
use serde::Deserialize;
use serde_saphyr::options::NonFiniteFloatPolicy;
use std::collections::BTreeMap;

/// Longest text; a rig of OpenCV has 3 kB.
pub const TEXT_BYTES_MAX: usize = 1 << 20;

/// What OpenCV's tag becomes: a map with this one key.
const MATRIX_TAG: &str = "opencv-matrix";

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Value {
    Number(f64),
    Truth(bool),
    Text(String),
    List(Vec<Self>),
    Map(BTreeMap<String, Self>),
    Nothing,
}

/// A file that is YAML, and a map.
#[derive(Debug)]
pub struct Document {
    file: String,
    root: BTreeMap<String, Value>,
}

/// A value of a document, and where it stands.
#[derive(Clone)]
pub struct Node<'a> {
    file: &'a str,
    key: String,
    value: &'a Value,
}

impl Document {
    /// `file` is what to call it in a refusal.
    ///
    /// # Errors
    /// [`Refused::Syntax`].
    pub fn parse(file: &str, text: &str) -> Result<Self, Refused> {
        let refused = |says: String| Refused::Syntax { file: file.to_owned(), says };
        if text.len() > TEXT_BYTES_MAX {
            return Err(refused(format!("{} bytes, expected at most 1 MiB", text.len())));
        }
        let text = text.trim_start_matches('\u{feff}');
        if text.trim_start().starts_with('<') {
            return Err(refused("XML, expected YAML; OpenCV writes a name.yml as YAML".to_owned()));
        }
        // Lines keep their numbers: the directive becomes a comment.
        let text = match text.strip_prefix('%') {
            Some(rest) => format!("#{rest}"),
            None => text.to_owned(),
        };
        let options = serde_saphyr::options! {
            with_snippet: false,
            // A key `y` or `no` is a name, not a truth.
            strict_booleans: true,
            non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
        };
        let root = serde_saphyr::from_str_with_options(&text, options)
            .map_err(|error| refused(format!("not a YAML map: {error}")))?;
        Ok(Self { file: file.to_owned(), root })
    }

    /// What it was called.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Whether a key stands at the top.
    #[must_use]
    pub fn has(&self, key: &str) -> bool {
        self.root.contains_key(key)
    }

    /// The value of a key at the top.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<Node<'_>> {
        let value = self.root.get(key)?;
        Some(Node { file: &self.file, key: key.to_owned(), value })
    }

    /// The same of one that must be there.
    ///
    /// # Errors
    /// [`Refused::Missing`].
    pub fn at(&self, key: &str, expected: &str) -> Result<Node<'_>, Refused> {
        self.get(key).ok_or_else(|| Refused::Missing {
            file: self.file.clone(),
            key: key.to_owned(),
            expected: expected.to_owned(),
        })
    }
}

impl<'a> Node<'a> {
    /// Its file.
    #[must_use]
    pub fn file(&self) -> &str {
        self.file
    }

    /// Its key, dotted.
    #[must_use]
    pub fn key(&self) -> &str {
        &self.key
    }

    /// A refusal of this value.
    #[must_use]
    pub fn refused(&self, got: String, expected: &str) -> Refused {
        let (file, key) = (self.file.to_owned(), self.key.clone());
        Refused::Value { file, key, got, expected: expected.to_owned() }
    }

    /// The value of a key below.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<Node<'a>> {
        let Value::Map(map) = self.value else { return None };
        let value = map.get(key)?;
        Some(Node { file: self.file, key: format!("{}.{key}", self.key), value })
    }

    /// The same of one that must be there.
    ///
    /// # Errors
    /// [`Refused::Missing`].
    pub fn at(&self, key: &str, expected: &str) -> Result<Node<'a>, Refused> {
        self.get(key).ok_or_else(|| Refused::Missing {
            file: self.file.to_owned(),
            key: format!("{}.{key}", self.key),
            expected: expected.to_owned(),
        })
    }

    /// A word.
    ///
    /// # Errors
    /// [`Refused::Value`].
    pub fn text(&self) -> Result<&'a str, Refused> {
        match self.value {
            Value::Text(text) => Ok(text),
            other => Err(self.refused(other.kind(), "a word")),
        }
    }

    /// A number that is finite.
    ///
    /// # Errors
    /// [`Refused::Value`].
    pub fn number(&self) -> Result<f64, Refused> {
        match self.value {
            Value::Number(number) if number.is_finite() => Ok(*number),
            other => Err(self.refused(other.kind(), "a finite number")),
        }
    }

    /// The side of an image.
    ///
    /// # Errors
    /// [`Refused::Value`].
    pub fn size_px(&self) -> Result<u32, Refused> {
        let number = self.number()?;
        let is_size = number.fract() == 0.0 && (1.0..=65535.0).contains(&number);
        match is_size {
            true => Ok(number as u32),
            false => Err(self.refused(number.to_string(), "a whole number of pixels")),
        }
    }

    /// All numbers of a list, of lists in a list, or of a matrix with `rows`, `cols` and `data`.
    ///
    /// # Errors
    /// [`Refused::Value`], [`Refused::Missing`].
    pub fn numbers(&self) -> Result<Vec<f64>, Refused> {
        if let Some(matrix) = self.get(MATRIX_TAG) {
            return Node { key: self.key.clone(), ..matrix }.numbers();
        }
        match self.value {
            Value::Map(_) => {
                let data = self.at("data", "the numbers of a matrix, row by row")?;
                let numbers = data.numbers()?;
                let sides = [self.at("rows", "a count")?, self.at("cols", "a count")?];
                let n = sides[0].number()? * sides[1].number()?;
                match numbers.len() as f64 == n {
                    true => Ok(numbers),
                    false => {
                        let got = format!("{} numbers", numbers.len());
                        Err(data.refused(got, &format!("{n}, as rows and cols say")))
                    }
                }
            }
            Value::List(list) => {
                let mut numbers = Vec::new();
                for (i, value) in list.iter().enumerate() {
                    let node = Node { file: self.file, key: format!("{}[{i}]", self.key), value };
                    match value {
                        Value::List(_) => numbers.extend(node.numbers()?),
                        _ => numbers.push(node.number()?),
                    }
                }
                Ok(numbers)
            }
            other => Err(self.refused(other.kind(), "a list or a matrix of numbers")),
        }
    }

    /// Exactly `M` numbers.
    ///
    /// # Errors
    /// As [`Node::numbers`].
    pub fn array<const M: usize>(&self, expected: &str) -> Result<[f64; M], Refused> {
        let numbers = self.numbers()?;
        let n = numbers.len();
        numbers.try_into().map_err(|_| self.refused(format!("{n} numbers"), expected))
    }

    /// Three rows of three.
    ///
    /// # Errors
    /// As [`Node::numbers`].
    pub fn square(&self) -> Result<[[f64; 3]; 3], Refused> {
        let [a, b, c, d, e, f, g, h, i] = self.array("a matrix of 3 x 3 numbers")?;
        Ok([[a, b, c], [d, e, f], [g, h, i]])
    }
}

impl Value {
    /// What to say of a value that is not what it should be.
    fn kind(&self) -> String {
        match self {
            Self::Number(number) => number.to_string(),
            Self::Truth(truth) => truth.to_string(),
            Self::Text(text) => format!("{:?}", text.chars().take(40).collect::<String>()),
            Self::List(list) => format!("a list of {}", list.len()),
            Self::Map(_) => "a map".to_owned(),
            Self::Nothing => "empty".to_owned(),
        }
    }
}
