//! A service of texts: JSON that some process wrote and others pass on as it is.

use crate::ports::{Alarm, alarm_of, notifier_of, wake_of};
use crate::services::{Error, MAX_NODES, refused};
use crate::table::Row;
use iceoryx2::port::{notifier::Notifier, publisher::Publisher, subscriber::Subscriber};
use iceoryx2::prelude::{BackpressureStrategy, Node, ServiceName, ipc};
use iceoryx2::service::port_factory::{event, publish_subscribe};

/// Longest text: a shot whose track has a sighting of both cameras in every frame of ten seconds.
pub const MAX_TEXT_BYTES: usize = 512 * 1024;

/// A service of texts.
#[derive(Debug)]
pub struct TextService {
    data: publish_subscribe::PortFactory<ipc::Service, [u8], ()>,
    wake: event::PortFactory<ipc::Service>,
}

/// Writes texts and wakes whoever reads them.
#[derive(Debug)]
pub struct TextWriter {
    publisher: Publisher<ipc::Service, [u8], ()>,
    notifier: Notifier<ipc::Service>,
}

/// Reads texts.
#[derive(Debug)]
pub struct TextReader(Subscriber<ipc::Service, [u8], ()>);

impl TextService {
    pub(crate) fn open(
        node: &Node<ipc::Service>,
        name: &ServiceName,
        row: Row,
    ) -> Result<Self, Error> {
        let data = node
            .service_builder(name)
            .publish_subscribe::<[u8]>()
            .max_publishers(row.writers)
            .max_subscribers(row.readers)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(row.depth)
            .subscriber_max_borrowed_samples(row.held)
            .history_size(0)
            .enable_safe_overflow(true)
            .open_or_create()
            .map_err(|e| refused(format!("open {name}"))(&e))?;
        Ok(Self { data, wake: wake_of(node, name, row)? })
    }

    /// The writing end.
    ///
    /// # Errors
    /// When there is a writer already.
    pub fn writer(&self) -> Result<TextWriter, Error> {
        let publisher = self
            .data
            .publisher_builder()
            .initial_max_slice_len(MAX_TEXT_BYTES)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| refused("write texts")(&e))?;
        Ok(TextWriter { publisher, notifier: notifier_of(&self.wake)? })
    }

    /// The reading end.
    ///
    /// # Errors
    /// When there are too many readers already.
    pub fn reader(&self) -> Result<TextReader, Error> {
        let subscriber = self.data.subscriber_builder().create();
        Ok(TextReader(subscriber.map_err(|e| refused("read texts")(&e))?))
    }

    /// An alarm that goes off when a text is written.
    ///
    /// # Errors
    /// When there are too many already.
    pub fn alarm(&self) -> Result<Alarm, Error> {
        alarm_of(&self.wake)
    }
}

impl TextWriter {
    /// Sends one text and says how many readers it reached.
    ///
    /// # Errors
    /// When it is longer than [`MAX_TEXT_BYTES`], or shared memory is gone.
    pub fn send(&self, text: &str) -> Result<usize, Error> {
        let loan = self.publisher.loan_slice_uninit(text.len());
        let loan = loan.map_err(|e| refused(format!("lend {} bytes", text.len()))(&e))?;
        let sent = loan.write_from_slice(text.as_bytes()).send();
        let n_reached = sent.map_err(|e| refused("send a text")(&e))?;
        self.notifier.notify().map_err(|e| refused("wake the readers")(&e))?;
        Ok(n_reached)
    }
}

impl TextReader {
    /// The oldest unread text, or `None`.
    ///
    /// # Errors
    /// When shared memory is gone.
    pub fn receive(&self) -> Result<Option<String>, Error> {
        let sample = self.0.receive().map_err(|e| refused("receive a text")(&e))?;
        Ok(sample.map(|sample| String::from_utf8_lossy(sample.payload()).into_owned()))
    }
}
