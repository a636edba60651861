//! The one way a process of this house says what it does: on stderr, as `RUST_LOG` asks for it.

use tracing_subscriber::EnvFilter;

/// Sends this process' words to stderr; only errors unless `RUST_LOG` says otherwise.
///
/// # Panics
/// When it is called twice.
pub fn to_stderr() {
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::from_default_env())
        .with_writer(std::io::stderr)
        .init();
}
