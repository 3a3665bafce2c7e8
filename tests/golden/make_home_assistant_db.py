"""Makes `home-assistant_v2.db` with Home Assistant itself: six days in a home.

It needs an environment of its own, in which Home Assistant is installed:

    python3.11 -m venv /tmp/ha
    /tmp/ha/bin/pip install homeassistant==2024.3.3 SQLAlchemy==2.0.28 \
        fnv-hash-fast==0.5.0 psutil-home-assistant==0.0.1
    /tmp/ha/bin/python tests/golden/make_home_assistant_db.py FILE

Home Assistant keeps the time by `time.time` and `datetime.now`; both are those of the
home here. The door's contact opens only while somebody moves in the hall; the two
contacts of the window are one, but for a message lost now and then; the heater is off
while the window is open.
"""

import asyncio
import datetime
import random
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

START = 1_750_000_000.0
DAY = 86_400


def readings(chance: random.Random) -> list[tuple[float, str, str]]:
    """Return when which entity has which state, in order."""
    told: list[tuple[float, str, str]] = []
    for entity in ("hall_motion", "front_door", "window", "window_2"):
        told.append((START, f"binary_sensor.{entity}", "off"))
    told.append((START, "switch.heater", "off"))
    told.append((START, "binary_sensor.attic", "unavailable"))
    for day in range(6):
        quarters = chance.sample(range(1, 95, 2), 11)
        for quarter in quarters[:6]:
            at = START + day * DAY + quarter * 900 + chance.uniform(0, 900)
            told.append((at, "binary_sensor.hall_motion", "on"))
            if chance.random() < 0.7:
                told.append((at + 5, "binary_sensor.front_door", "on"))
                told.append((at + 20, "binary_sensor.front_door", "off"))
            told.append((at + 60, "binary_sensor.hall_motion", "off"))
        for quarter in quarters[6:]:
            at = START + day * DAY + quarter * 900 + chance.uniform(0, 900)
            told.append((at - 30, "switch.heater", "off"))
            for entity in ("window", "window_2"):
                if entity == "window" or chance.random() > 0.05:
                    told.append((at, f"binary_sensor.{entity}", "on"))
                told.append((at + 600, f"binary_sensor.{entity}", "off"))
            told.append((at + 660, "switch.heater", "on"))
        for hour in range(0, 24, 2):
            warm = 19 + 3 * (8 <= hour <= 20) + chance.uniform(-0.4, 0.4)
            at = START + day * DAY + hour * 3600
            told.append((at, "sensor.hall_temperature", f"{warm:.1f}"))
    told.append((START + 3 * DAY, "binary_sensor.hall_motion", "unavailable"))
    told.append((START + 3 * DAY + 50, "binary_sensor.hall_motion", "off"))
    return sorted(told, key=lambda each: each[0])


async def write(path: Path, folder: str) -> None:
    """Let Home Assistant record the readings."""
    from homeassistant import config_entries, core, loader
    from homeassistant.components import recorder
    from homeassistant.helpers import entity_registry, translation
    from homeassistant.helpers.recorder import async_initialize_recorder
    from homeassistant.setup import async_setup_component

    hass = core.HomeAssistant(folder)
    hass.config.skip_pip = True
    loader.async_setup(hass)
    hass.config_entries = config_entries.ConfigEntries(hass, {})
    translation.async_setup(hass)
    async_initialize_recorder(hass)
    await entity_registry.async_load(hass)
    options = {"db_url": f"sqlite:///{path}", "commit_interval": 0}
    assert await async_setup_component(hass, "recorder", {"recorder": options})
    await hass.async_start()
    await recorder.get_instance(hass).async_recorder_ready.wait()
    home = START

    class Then(datetime.datetime):
        @classmethod
        def now(cls, tz: datetime.tzinfo | None = None) -> "Then":
            return cls.fromtimestamp(home, tz)

    with (
        patch("time.time", lambda: home),
        patch("homeassistant.util.dt.utcnow", lambda: Then.now(datetime.UTC)),
        patch("homeassistant.core.dt_util.utcnow", lambda: Then.now(datetime.UTC)),
    ):
        for at, entity, state in readings(random.Random(0)):
            home = at
            hass.states.async_set(entity, state, {"friendly_name": entity})
            await hass.async_block_till_done()
        await recorder.get_instance(hass).async_block_till_done()
    await hass.async_stop(force=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(write(Path(sys.argv[1]).absolute(), folder))
