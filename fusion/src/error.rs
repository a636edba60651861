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
    /// A `rig.toml` that cannot be used, with its place.
    #[error("{place}: {source}")]
    RigFile {
        /// The file, and the line if one is to blame.
        place: String,
        /// What is wrong.
        source: Box<Self>,
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

impl Error {
    /// The line of `text`, a `rig.toml`, whose value is refused; 1 is the first. Syntax errors name
    /// theirs themselves, and what is missing has none.
    #[must_use]
    pub fn rig_line(&self, text: &str) -> Option<usize> {
        let Self::RigValue { field, .. } = self else { return None };
        let (table, key) = field.split_once('.')?;
        let is_table = |line: &str| line.trim_start().starts_with(&format!("[{table}]"));
        let is_key = |line: &str| line.split('=').next().is_some_and(|name| name.trim() == key);
        let lines = || text.lines().enumerate();
        let (table_idx, _) = lines().find(|(_, line)| is_table(line))?;
        lines().skip(table_idx + 1).find(|(_, line)| is_key(line)).map(|(idx, _)| idx + 1)
    }
}

#[cfg(test)]
mod tests {
    use crate::world::rig::Rig;

    #[test]
    fn a_refused_value_is_found_in_its_own_table() {
        let text = crate::pretend::REFERENCE_RIG;
        let focal = "focal_px            = [1240.0, 1240.0]";
        let (left, right) = text.split_at(text.find("[right]").unwrap());
        let spoiled = format!("{left}{}", right.replace(focal, "focal_px = [-1.0, 1240.0]"));
        let expected = spoiled.lines().position(|line| line.contains("[-1.0")).unwrap() + 1;
        let error = spoiled.parse::<Rig>().unwrap_err();
        assert_eq!(error.rig_line(&spoiled), Some(expected), "{error}");
        assert_eq!("[left".parse::<Rig>().unwrap_err().rig_line("[left"), None);
    }
}
