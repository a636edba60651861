//! One launcher for one camera.
//!
//! The claim is an abstract Unix socket: it has no file, the kernel gives it up with the process
//! however that ends, and it holds for all users of the machine.

use shm_layout::Camera;
use std::io;
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::net::{SocketAddr, UnixListener};

/// Held by the launcher of a board for as long as it lives.
#[derive(Debug)]
pub struct Claim(#[expect(dead_code, reason = "held")] UnixListener);

impl Claim {
    /// Claims a board; `None` if another launcher has it.
    ///
    /// # Errors
    /// When the system refuses the socket.
    pub fn of(court: &str, camera: Camera) -> io::Result<Option<Self>> {
        let address = SocketAddr::from_abstract_name(format!("tennis-board-{court}-{camera}"))?;
        match UnixListener::bind_addr(&address) {
            Ok(socket) => Ok(Some(Self(socket))),
            Err(why) if why.kind() == io::ErrorKind::AddrInUse => Ok(None),
            Err(why) => Err(why),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_is_claimed_once_until_it_is_given_up() {
        let court = format!("claim-{}", std::process::id());
        let claim = Claim::of(&court, Camera::Left).unwrap();
        assert!(claim.is_some());
        assert!(Claim::of(&court, Camera::Left).unwrap().is_none());
        assert!(Claim::of(&court, Camera::Right).unwrap().is_some());
        drop(claim);
        assert!(Claim::of(&court, Camera::Left).unwrap().is_some());
    }
}
