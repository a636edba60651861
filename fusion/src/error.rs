//! Everything the outside world can get wrong in a file this room reads.
//!
//! The pipeline itself has no errors: bad candidates are dropped and counted ([`crate::Dropped`]).

/// A `rig.toml` or a candidates CSV that cannot be used; the text says where and what was expected.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Not TOML, or a value of the wrong type; toml's own text names line and column.
    #[error("{0}")]
    RigSyntax(String),
    /// A table or key that must be there is not.
    #[error("`{field}` is missing: {expected}")]
    RigMissing {
        /// The table or key, dotted.
        field: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// A value no real rig can have.
    #[error("`{field}` is {got}, expected {expected}")]
    RigValue {
        /// The key, dotted.
        field: String,
        /// The value found.
        got: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// The bytes could not be read or written, or are not CSV.
    #[error("{label}: {source}")]
    Csv {
        /// Which file, as the caller calls it.
        label: String,
        /// csv's own account, with its line number.
        source: csv::Error,
    },
    /// A column is missing from the header.
    #[error(
        "{label}, line 1: no column `{column}`; expected `t_ns,x_px,y_px` and optionally \
             `width_px,height_px,area_px`"
    )]
    CsvColumn {
        /// Which file, as the caller calls it.
        label: String,
        /// The column that is missing.
        column: &'static str,
    },
    /// A field that is not what its column promises.
    #[error("{label}, line {line}: `{column}` is {got:?}, expected {expected}")]
    CsvField {
        /// Which file, as the caller calls it.
        label: String,
        /// 1 is the header.
        line: u64,
        /// The column of the field.
        column: &'static str,
        /// The field as it stands in the file.
        got: String,
        /// What would be accepted.
        expected: &'static str,
    },
}
