//! Values of a TOML file with their place in it → errors that name file and line.

use crate::Error;
use serde::de::DeserializeOwned;
use std::ops::RangeInclusive;
use toml::Spanned;

/// A file's name and text.
#[derive(Debug, Clone, Copy)]
pub struct File<'a> {
    /// As the user calls it.
    pub name: &'a str,
    /// What stands in it.
    pub text: &'a str,
}

impl File<'_> {
    /// All of it.
    ///
    /// # Errors
    /// What toml says, with the file's name; it names the line itself.
    pub fn view<V: DeserializeOwned>(&self) -> Result<V, Error> {
        toml::from_str(self.text).map_err(|why| Error::RigFile {
            place: self.name.to_owned(),
            source: Box::new(Error::RigSyntax(why.to_string())),
        })
    }

    /// A value is not what it should be.
    #[must_use]
    pub fn refused<T>(
        &self,
        at: &Spanned<T>,
        field: &str,
        got: String,
        expected: &'static str,
    ) -> Error {
        let before = self.text.get(..at.span().start).unwrap_or(self.text);
        let line = before.matches('\n').count() + 1;
        let source = Error::RigValue { field: field.to_owned(), got, expected };
        Error::RigFile { place: format!("{}, line {line}", self.name), source: Box::new(source) }
    }

    /// A number in a range.
    ///
    /// # Errors
    /// When it is not.
    pub fn within(
        &self,
        value: &Spanned<f64>,
        field: &str,
        range: RangeInclusive<f64>,
        expected: &'static str,
    ) -> Result<f64, Error> {
        let got = *value.get_ref();
        if range.contains(&got) {
            Ok(got)
        } else {
            Err(self.refused(value, field, got.to_string(), expected))
        }
    }
}
