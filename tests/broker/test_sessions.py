"""Sessions at both brokers: take-over of a client id, wills, retained messages, the queue of a client that is away."""

from __future__ import annotations

import queue
from contextlib import ExitStack

import pytest

from tests.broker.running import Client, wait_until

TAKEN_OVER = 142  # DISCONNECT of MQTT 5
TWINS = 12
QUEUED = 60


def test_a_newer_connection_ends_the_older_one_of_its_client_id_and_hears(broker, join, version, topic):
    sender, older = join(broker), join(broker, f"device-{version}")
    older.subscribe(topic)
    newer = join(broker, f"device-{version}")
    newer.subscribe(topic)
    code = older.ends.get(timeout=60.0)
    assert code != 0
    if (broker.name, version) == ("embedded", "5"):  # mosquitto 2.0.11 hangs up without the word
        assert code == TAKEN_OVER
    assert newer.hears(sender, topic)
    assert newer.ends.empty()


def test_whoever_comes_last_of_many_with_one_client_id_hears(broker, join, version, topic):
    """The end of one connection never takes away what belongs to the next."""
    sender = join(broker)
    for _ in range(25):
        last = join(broker, f"device-{version}")
        last.subscribe(topic)
        assert last.hears(sender, topic)


def test_of_many_that_come_at_once_with_one_client_id_one_stays_and_hears(broker, join, version, topic):
    sender = join(broker)
    with ExitStack() as ended:
        twins = [Client(broker.port, f"twin-{version}", version, topics=(topic,)) for _ in range(TWINS)]
        for twin in twins:
            ended.callback(twin.close)
        wait_until(lambda: sum(not twin.ends.empty() for twin in twins) == TWINS - 1)
        (left,) = (twin for twin in twins if twin.ends.empty())
        left.connected()
        assert left.hears(sender, topic)


def test_a_device_hears_again_after_another_client_had_its_id_for_a_while(broker, join, version, topic):
    """The device connects anew, which ends the other one; so it goes on as long as both live."""
    sender = join(broker)
    device = join(broker, f"gemelo-device-{version}", comes_back=True, topics=(topic,))
    other = join(broker, f"gemelo-device-{version}")
    device.ends.get(timeout=60.0)
    device.connected()
    other.ends.get(timeout=60.0)
    assert device.hears(sender, topic)


def test_the_will_of_the_older_connection_comes_before_what_the_newer_one_says(broker, join, topic):
    reader = join(broker)
    reader.subscribe(topic)
    for _ in range(10):
        join(broker, "with-a-will", will=(topic, "offline", True)).publish(topic, "online", retain=True)
        assert reader.next() == (topic, "online")
        newer = join(broker, "with-a-will", will=(topic, "offline", True))
        newer.publish(topic, "online", retain=True)
        assert reader.next() == (topic, "offline")
        assert reader.next() == (topic, "online")
        newer.close()


def test_a_client_that_dies_leaves_its_will_and_one_that_leaves_none(broker, join, topic):
    reader = join(broker)
    reader.subscribe(topic)
    join(broker, will=(topic, "died", True)).cut()
    assert reader.next() == (topic, "died")
    join(broker, will=(topic, "left", False)).close()
    assert reader.hears(join(broker), topic)  # nothing before it but the mark, or the next line fails
    late = join(broker)
    late.subscribe(topic)
    assert late.next() == (topic, "died")


def test_no_will_comes_of_a_client_that_says_that_it_leaves(broker, join, topic):
    reader, sender = join(broker), join(broker)
    reader.subscribe(topic)
    join(broker, will=(topic, "left", False)).close()
    sender.publish(topic, "after")
    assert reader.next() == (topic, "after")


def test_a_late_subscriber_gets_what_was_retained_last_until_it_is_taken_back(broker, join, topic):
    writer = join(broker)
    for payload in ("first", "second"):
        writer.publish(topic, payload, retain=True)
    late = join(broker)
    late.subscribe(topic)
    message = late.messages.get(timeout=60.0)
    assert (message.payload, message.retain) == (b"second", True)
    writer.publish(topic, "third", retain=True)
    message = late.messages.get(timeout=60.0)
    assert (message.payload, message.retain) == (b"third", False)  # to whom was there it is news
    writer.publish(topic, "", retain=True)
    assert late.next() == (topic, "")
    later = join(broker)
    later.subscribe(topic)
    assert later.hears(writer, topic)
    assert later.messages.empty()


def test_a_client_that_was_away_gets_every_message_of_qos_1_in_order(broker, join, version, topic):
    name, sender = f"away-{version}", join(broker)
    join(broker, name, keeps=True).close()
    absent = join(broker, name, keeps=True)
    absent.subscribe(f"{topic}/#")
    absent.close()
    for number in range(QUEUED):
        sender.publish(f"{topic}/one", str(number))
    back = join(broker, name, keeps=True)
    assert back.has_session
    assert [back.next()[1] for _ in range(QUEUED)] == [str(number) for number in range(QUEUED)]
    assert back.hears(sender, f"{topic}/one")


def test_a_session_that_is_begun_anew_has_neither_queue_nor_subscriptions(broker, join, version, topic):
    name, sender = f"anew-{version}", join(broker)
    absent = join(broker, name, keeps=True)
    absent.subscribe(topic)
    absent.close()
    sender.publish(topic, "meanwhile")
    anew = join(broker, name)
    assert not anew.has_session
    sender.publish(topic, "not subscribed")
    anew.subscribe(f"{topic}/else")
    assert anew.hears(sender, f"{topic}/else")
    with pytest.raises(queue.Empty):
        anew.messages.get_nowait()


def test_what_a_client_has_not_acknowledged_comes_again_whatever_ids_it_has_used_itself(broker, join, version, topic):
    """Both ends number their messages from 1: what one of them sends says nothing of what it was sent."""
    name, sender = f"silent-{version}", join(broker)
    silent = join(broker, name, keeps=True)
    silent.subscribe(topic)
    silent.paho.manual_ack_set(True)
    sent = [str(number) for number in range(20)]
    for each in sent:
        sender.publish(topic, each)
        silent.next()
        silent.publish(f"{topic}/else", each)
    silent.cut()
    back = join(broker, name, keeps=True)
    assert [back.next()[1] for _ in sent] == sent


def test_a_client_hears_for_as_long_as_both_sides_send(broker, join, topic):
    """More messages of QoS 1 in both directions than any of the broker's windows."""
    client = join(broker)
    client.subscribe(topic)
    for number in range(1500):
        client.paho.publish(topic, str(number), qos=1)
        assert client.next() == (topic, str(number))
