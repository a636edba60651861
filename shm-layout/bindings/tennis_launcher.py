"""A court's shared memory for Python, by iceoryx2 of PyPI (pip install iceoryx2==0.10.0).

The place where shots, corrections and the launcher's commands and answers meet is fusion's domain
of a court; its processes see each other by the prefix of their files and a root path, and every
service is opened with the numbers of tennis_messages.SERVICES, whoever comes first.
"""

import os
import re
import time

import iceoryx2 as iox2
from tennis_messages import MAX_NODES, SERVICES


def now_ns():
    """Now, on the clock of every stamp."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


class Court:
    """A process called `name` in fusion's domain of a court."""

    def __init__(self, court, name):
        if not re.fullmatch("[a-z0-9-]{1,32}", court):
            raise ValueError(f"court name {court!r}: expected 1 to 32 of a-z, 0-9 and '-'")
        iox2.set_log_level(iox2.LogLevel.Error)
        config = iox2.config.default()
        config.global_cfg.prefix = iox2.FileName.new(f"tennis_{court}_fusion_")
        config.global_cfg.root_path = iox2.Path.new(f"/tmp/tennis-{os.getuid()}/")
        self._node = (
            iox2.NodeBuilder.new()
            .name(iox2.NodeName.new(name))
            .config(config)
            .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            .create(iox2.ServiceType.Ipc)
        )

    def _service(self, name):
        message, writers, readers, depth = SERVICES[name]
        service = iox2.ServiceName.new(name)
        data = (
            self._node.service_builder(service)
            .publish_subscribe(message)
            .max_publishers(writers)
            .max_subscribers(readers)
            .max_nodes(MAX_NODES)
            .subscriber_max_buffer_size(depth)
            .subscriber_max_borrowed_samples(1)
            .history_size(0)
            .enable_safe_overflow(True)
            .open_or_create()
        )
        wake = (
            self._node.service_builder(service)
            .event()
            .max_notifiers(writers)
            .max_listeners(readers)
            .max_nodes(MAX_NODES)
            .open_or_create()
        )
        return data, wake

    def reader(self, name):
        """Reads a service's messages."""
        return Reader(name, *self._service(name))

    def writer(self, name):
        """Writes a service's messages, and wakes whoever reads them."""
        return Writer(name, *self._service(name))


class Reader:
    """The reading end of a service."""

    def __init__(self, name, data, wake):
        self._message = SERVICES[name][0]
        self._subscriber = data.subscriber_builder().create()
        self._listener = wake.listener_builder().create()

    def receive(self):
        """The oldest unread message, copied; None if there is none."""
        sample = self._subscriber.receive()
        if sample is None:
            return None
        copy = self._message.from_buffer_copy(sample.payload().contents)
        sample.delete()
        return copy

    def all(self):
        """All that is unread, the oldest first."""
        return iter(self.receive, None)

    def wait(self, at_most_s):
        """Sleeps until something is sent, a signal came, or so long."""
        try:
            self._listener.timed_wait(iox2.Duration.from_millis(max(1, int(at_most_s * 1e3))))
        except iox2.ListenerWaitError as why:
            if str(why) != "InterruptSignal":
                raise


class Writer:
    """The writing end of a service."""

    def __init__(self, name, data, wake):
        self._message = SERVICES[name][0]
        self._publisher = (
            data.publisher_builder()
            .max_loaned_samples(1)
            .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
            .create()
        )
        self._notifier = wake.notifier_builder().create()

    def send(self, message):
        """Sends one message."""
        if not isinstance(message, self._message):
            raise TypeError(f"{type(message).__name__}: expected {self._message.__name__}")
        self._publisher.send_copy(message)
        self._notifier.notify()
