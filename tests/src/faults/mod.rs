//! Everything that runs on a court, with faults on purpose: is what ARCHITECTURE.md promises under
//! "Failure" kept?
//!
//! A [`site`] is the real thing, its recordings [`spoiled`] if asked: both boards under their
//! launchers, the units beside fusion under a [`keeper`], page and recorder included. Its [`part`]s
//! are killed or stood still ([`campaign`]), [`gauges`] say what each takes of the machine, and
//! every ball that was [`served`] is measured, or explained by what was done ([`balance`]), or it
//! is a [`report`]ed failure. A [`picture`] shows hours of it.

pub mod part;

pub mod keeper;

pub mod served;

pub mod spoiled;

pub mod site;

pub mod gauges;

pub mod campaign;

pub mod balance;

pub mod report;

pub mod picture;
