"""The hubs in memory: order, reordering, and each fault that can be simulated."""

import asyncio

from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.fabric.in_memory import MemoryHub
from tests.support.memory_hubs import run_out
from tests.support.patience import PATIENCE
from tools.simulate.simulated_hub import Faults, SimulatedHub

Log = list[tuple[str, int]]  # who sent it, and its number


def listener(hub: MemoryHub, who: str = "listener", *keys: str) -> Log:
    """Add a part that notes what it hears."""
    log: Log = []

    def note(deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            sender = wire.decode(delivery.key, delivery.payload).sender
            log.append((sender, delivery.sequence))

    hub.fabric(who).listen(keys or ("**",), note)
    return log


def chatter(hub: MemoryHub, senders: int, each: int) -> None:
    """Let some senders publish in turns."""
    ends = [hub.fabric(f"s{number}") for number in range(senders)]
    for _ in range(each):
        for end in ends:
            end.publish(wire.Leave(end.who))


def numbers(log: Log, who: str) -> list[int]:
    return [number for sender, number in log if sender == who]


# Order --------------------------------------------------------------------------------


@given(st.integers(0, 2**32))
def test_with_a_seed_senders_overtake_each_other_and_each_keeps_its_order(
    seed: int,
) -> None:
    hub = SimulatedHub(seed)
    log = listener(hub)
    chatter(hub, senders=3, each=20)
    run_out(hub)
    assert all(numbers(log, f"s{s}") == list(range(20)) for s in range(3))


def test_a_seed_gives_an_order_and_faults_and_none_gives_neither() -> None:
    def heard(seed: int) -> Log:
        faults = Faults(duplicate=0.2, drop=0.1)
        hub = SimulatedHub(seed, faults) if seed else MemoryHub()
        log = listener(hub)
        chatter(hub, senders=3, each=20)
        assert hub.pending == 60 or seed
        run_out(hub)
        return log

    assert heard(0) == [(f"s{s}", number) for number in range(20) for s in range(3)]
    assert len({tuple(heard(seed)) for seed in range(4)}) == 4
    assert heard(1) == heard(1)


def test_what_is_under_way_to_whoever_leaves_is_for_nobody_of_its_name() -> None:
    hub = MemoryHub()
    stays, leaves = listener(hub, "stays"), listener(hub, "leaves")
    end = hub.fabric("sender")
    end.publish(wire.Leave("sender"))
    hub.leave("leaves")
    assert hub.pending == 1
    again = listener(hub, "leaves")
    end.publish(wire.Leave("sender"))
    run_out(hub)
    assert (leaves, again) == ([], [("sender", 1)])
    assert stays == [("sender", 0), ("sender", 1)]


# Faults -------------------------------------------------------------------------------


def test_a_duplicate_comes_later_and_what_is_dropped_leaves_a_gap() -> None:
    twice, lossy = Faults(duplicate=0.3), Faults(drop=0.3)
    for faults, least, most in ((twice, 340, 440), (lossy, 150, 270)):
        hub = SimulatedHub(5, faults)
        log = listener(hub)
        chatter(hub, senders=1, each=300)
        run_out(hub)
        heard = numbers(log, "s0")
        assert least < len(heard) < most
        firsts = list(dict.fromkeys(heard))
        assert firsts == (sorted({*heard}) if faults is lossy else [*range(300)])


def test_a_cut_link_loses_what_was_under_way_and_what_comes() -> None:
    hub = SimulatedHub(3)
    far, near = listener(hub, "far"), listener(hub, "near")
    end = hub.fabric("sender")

    def send() -> None:
        end.publish(wire.Leave("sender"))

    send()
    run_out(hub)
    send()
    hub.cut("sender", "far")
    send()
    run_out(hub)
    hub.heal("far", "sender")
    send()
    run_out(hub)
    assert numbers(far, "sender") == [0, 3]
    assert numbers(near, "sender") == [0, 1, 2, 3]
    assert hub.pending == 0


# Parts --------------------------------------------------------------------------------


async def test_other_tasks_get_their_turn_in_a_flood() -> None:
    hub = MemoryHub()
    stop = asyncio.Event()

    async with hub.fabric("echo") as end:
        await end.subscribe(("leave/**",), lambda _: end.publish(wire.Leave("echo")))
        end.publish(wire.Leave("echo"))
        asyncio.get_running_loop().call_later(0.01, stop.set)
        async with asyncio.timeout(PATIENCE):
            await end.serve(stop)
    assert end.sent > 1
