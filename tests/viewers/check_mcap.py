"""Whether other people's readers open a recording of `record`: run by hand, it needs packages.

    python3 -m venv /tmp/venv
    /tmp/venv/bin/pip install mcap mcap-protobuf-support
    /tmp/venv/bin/python tests/viewers/check_mcap.py FILE.mcap..

A finished file must have its summary, and every schema must decode its messages; the file of a
killed recorder is read from the front, up to where it ends.
"""

import collections
import json
import sys

from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory


def look_at(path):
    factory = DecoderFactory()
    schemas, channels, counts, sizes = {}, {}, collections.Counter(), collections.Counter()
    last_ns, first_ns, is_cut_off, last = 0, None, False, {}
    with open(path, "rb") as stream:
        try:
            for record in StreamReader(stream, validate_crcs=True).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    schema = schemas[channel.schema_id]
                    if channel.message_encoding == "protobuf":
                        last[channel.topic] = factory.decoder_for("protobuf", schema)(record.data)
                    elif channel.message_encoding == "json":
                        last[channel.topic] = json.loads(record.data)
                    assert record.log_time >= last_ns, "times of reading run forward"
                    last_ns, first_ns = record.log_time, first_ns or record.log_time
                    counts[channel.topic] += 1
                    sizes[channel.topic] += len(record.data)
        except EndOfFile:
            is_cut_off = True
    print(f"{path}: {(last_ns - first_ns) / 1e9:.1f} s{', cut off' if is_cut_off else ''}")
    for topic in sorted(counts):
        channel = next(c for c in channels.values() if c.topic == topic)
        print(f"  {topic}: {counts[topic]} of {schemas[channel.schema_id].name}, {sizes[topic]} B")
    return counts, is_cut_off, last


def check_summary(path, counts):
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        by_topic = {summary.channels[i].topic: n
                    for i, n in summary.statistics.channel_message_counts.items()}
        assert by_topic == dict(counts), (by_topic, counts)
        n = sum(1 for _ in reader.iter_messages())
        assert n == summary.statistics.message_count
        names = [attachment.name for attachment in reader.iter_attachments()]
        about = {m.name: dict(m.metadata) for m in reader.iter_metadata()}
        print(f"  summary: {len(summary.chunk_indexes)} chunks, attached {names}, {about}")


for path in sys.argv[1:]:
    counts, is_cut_off, last = look_at(path)
    if not is_cut_off:
        check_summary(path, counts)
    for topic, message in last.items():
        if topic.endswith("/image"):
            assert message.encoding == "mono8" and message.step == message.width
            assert len(message.data) == message.step * message.height
            print(f"  {topic}: {message.width}x{message.height}")
        elif topic.endswith("/annotations"):
            print(f"  {topic}: {len(message.circles)} circles in the last")
        elif topic == "/scene":
            print(f"  {topic}: {[entity.id for entity in message.entities]}")
