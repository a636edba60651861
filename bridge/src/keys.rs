//! The key expressions under which a court's machines meet.
//!
//! ```text
//! court/<name>/<left|right>/candidates     batches of what the workers found
//! court/<name>/<left|right>/frames-info    batches of what is known of every frame
//! court/<name>/<left|right>/missing        query: batches of these that did not arrive
//! court/<name>/<left|right>/ping, pong     what the time is on the board
//! court/<name>/<left|right>/command        query of the bridge beside fusion: do this
//! court/<name>/command/<left|right>        query of a commander, which that bridge passes on
//! court/<name>/<left|right>/health         how the board is
//! court/<name>/<left|right|fusion>/alive/v<VERSION>   token of who is there, and what it speaks
//! court/<name>/shot, correction            a shot, a correction as JSON
//! court/<name>/wanted                      of a controller elsewhere: what the next ball should be
//! court/<name>/launcher/command, answer    what the launcher is told, and says
//! ```

use crate::wire::VERSION;
use crate::{Error, network};
use shm_layout::Camera;
use shm_layout::services::Place;
use zenoh::key_expr::OwnedKeyExpr;

/// A key of a board: `what` is its last part, or parts.
///
/// # Errors
/// When `court` cannot be part of a key.
pub fn of_board(court: &str, camera: Camera, what: &str) -> Result<OwnedKeyExpr, Error> {
    key_from(format!("court/{court}/{camera}/{what}"))
}

/// Where a commander asks the bridge beside fusion to pass a command on. No board may ask there.
///
/// # Errors
/// When `court` cannot be part of a key.
pub fn command(court: &str, camera: Camera) -> Result<OwnedKeyExpr, Error> {
    key_from(format!("court/{court}/command/{camera}"))
}

/// A key of the court as a whole: `what` is its last part, or parts.
///
/// # Errors
/// When `court` cannot be part of a key.
pub fn of_court(court: &str, what: &str) -> Result<OwnedKeyExpr, Error> {
    key_from(format!("court/{court}/{what}"))
}

/// The key of a court's shots; `*` is every court.
///
/// # Errors
/// When `court` cannot be part of a key.
pub fn shot(court: &str) -> Result<OwnedKeyExpr, Error> {
    key_from(format!("court/{court}/shot"))
}

/// The token by which a process says that it is there and what it speaks.
///
/// # Errors
/// When `court` cannot be part of a key.
pub fn alive(court: &str, place: Place) -> Result<OwnedKeyExpr, Error> {
    key_from(format!("court/{court}/{}/alive/v{VERSION}", place.name()))
}

/// All tokens of a place, whatever it speaks.
///
/// # Errors
/// When `court` cannot be part of a key.
pub fn alive_in_any_version(court: &str, place: Place) -> Result<OwnedKeyExpr, Error> {
    key_from(format!("court/{court}/{}/alive/*", place.name()))
}

/// The version that a token tells; `None` if it is no such token.
#[must_use]
pub fn version_of(token: &str) -> Option<u16> {
    token.rsplit('/').next()?.strip_prefix('v')?.parse().ok()
}

fn key_from(key: String) -> Result<OwnedKeyExpr, Error> {
    OwnedKeyExpr::try_from(key.as_str()).map_err(network(format!("use the key {key}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_tells_its_version() {
        let token = alive("club-3", Place::Board(Camera::Left)).unwrap();
        assert_eq!(version_of(token.as_str()), Some(VERSION));
        assert!(
            alive_in_any_version("club-3", Place::Board(Camera::Left)).unwrap().includes(&token)
        );
        assert_eq!(version_of("court/club-3/left/alive"), None);
    }

    #[test]
    fn every_court_is_a_key_of_its_own() {
        assert!(shot("*").unwrap().includes(&shot("a").unwrap()));
        assert!(!shot("a").unwrap().includes(&shot("b").unwrap()));
    }
}
