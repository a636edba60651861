//! The board's shared memory → its account, and its clock; cleared of what dead processes left.

use crate::account::Account;
use crate::stuck::Answers;
use shm_layout::ports::{MessageReader, MessageService};
use shm_layout::services::{Domain, Error, Member};
use shm_layout::stamp::{OWN_CLOCK, now_ns};
use shm_layout::{FrameInfo, Link, StripCandidates};
use std::time::Instant;

/// The clock is not known any more when nobody has told for so long.
const TOLD_WITHIN_NS: i64 = 2_000_000_000;

/// What the launcher reads.
#[derive(Debug)]
pub struct Memory {
    infos: Infos,
    strips: MessageReader<StripCandidates>,
    links: MessageReader<Link>,
    link: Option<Link>,
    /// Every frame so far.
    pub account: Account,
    /// Which of them workers have not answered.
    pub answers: Answers,
    /// Dropped last: what it opened goes with it.
    _member: Member,
}

/// Capture takes any reader of the infos for the bridge: one that is to wait for the bridge must
/// not find us there before.
#[derive(Debug)]
enum Infos {
    Read(MessageReader<FrameInfo>),
    AfterBridge(MessageService<FrameInfo>),
}

impl Memory {
    /// Opens it; `after_bridge` if capture waits for the bridge.
    ///
    /// # Errors
    /// When shared memory cannot be had.
    pub fn open(domain: &Domain, after_bridge: bool) -> Result<Self, Error> {
        let member = domain.join("launcher")?;
        let infos = member.frames_info()?;
        let infos =
            if after_bridge { Infos::AfterBridge(infos) } else { Infos::Read(infos.reader()?) };
        let (strips, links) = (member.candidates()?.reader()?, member.links()?.reader()?);
        let (account, answers) = (Account::default(), Answers::default());
        Ok(Self { infos, strips, links, link: None, account, answers, _member: member })
    }

    /// Takes in all that is there.
    ///
    /// # Errors
    /// When shared memory is gone.
    pub fn take(&mut self) -> Result<(), Error> {
        if let Infos::AfterBridge(service) = &self.infos
            && service.n_readers() > 0
        {
            self.infos = Infos::Read(service.reader()?);
        }
        if let Infos::Read(infos) = &self.infos {
            while let Some(info) = infos.receive()? {
                self.account.update_info(&info);
                self.answers.update_frame(Instant::now());
            }
        }
        while let Some(strip) = self.strips.receive()? {
            self.account.update(&strip);
            self.answers.update(strip.strip_idx);
        }
        while let Some(link) = self.links.receive()? {
            self.link = Some(*link);
        }
        Ok(())
    }

    /// 1 sigma of the board's clock as fusion knows it; `None` while nobody tells.
    #[must_use]
    pub fn clock_sigma_ns(&self) -> Option<u32> {
        let link = self.link.filter(|link| now_ns() - link.noted_ns < TOLD_WITHIN_NS)?;
        (link.is_alive != 0 && link.clock_sigma_ns != OWN_CLOCK).then_some(link.clock_sigma_ns)
    }
}
