"""Files of readings of every format, as tables and as sources, and invalid files."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.columns import Columns
from neurosnap.sources.conditions import parse_condition
from neurosnap.sources.meaning import RULE, compared, numbers_in
from neurosnap.sources.open import open_source
from neurosnap.sources.open_readings import FileSource, open_readings
from neurosnap.sources.readings import Readings, seconds_of
from neurosnap.sources.wanted import Wanted
from tests.support.sources import README, everything, readings, written

HOME = Path(__file__).parents[2] / "golden" / "home-assistant_v2.db"


def shown(readings: Readings) -> dict[str, str]:
    """What each sensor read, a letter a tick; ? is unknown."""
    columns = readings.columns
    return {
        name: "".join(
            "?" if not sure else "1" if bit else "0"
            for bit, sure in zip(columns.reading(k), columns.known(k), strict=True)
        )
        for k, name in enumerate(columns.sensorium)
    }


def read(folder: Path, text: str, wanted: Wanted | None = None) -> Readings:
    return open_readings(str(written(folder, text)), wanted)


def refused(folder: Path, text: str, wanted: Wanted | None = None) -> str:
    path = written(folder, text)
    with pytest.raises(InvalidValueError) as caught:
        open_readings(str(path), wanted)
    return str(caught.value).replace(str(path), "{}")


@pytest.mark.parametrize(
    "text",
    [
        "a,b\n0,1\n1,\n\n  \n\n",
        "\ufeffa,b\n0,1\n1,",
        "a;b\n0;1\n1;\n",
        "a\tb\n0\t1\n1\t\n",
        "a,b\nFalse,True\nTrue,NA\n",
        "a,b\noff,on\nOn,unavailable\n",
        "a,b\n0.0,1.0\n1.0,NaN\n",
        ",a,b\n0,0,1\n1,1,\n",
        '"a",b\n"0","1"\n1,""\n',
        " a , b \n0, 1\n1 , \n",
        "a,b\r\n0,1\r\n1,None\r\n",
        '"a";"b"\n0;1\n1;\n',
        "time,a,b\n0.5,0,1\n2026-07-01 12:00,1,\n",
        "\ufefftime,a,b\r\n,0,1\r\n,1,\r\n",
    ],
)
def test_ways_to_write_a_table(tmp_path: Path, text: str) -> None:
    assert shown(read(tmp_path, text)) == {"a": "01", "b": "1?"}
    source = open_source(str(written(tmp_path, text)), 0)
    assert (source.sensors, source.length) == (("a", "b"), 2)
    told = [readings(seen) for seen in (source.first(), source.step(0)) if seen]
    assert told == [[False, True], [True, None]]


def test_beside_a_comparison_other_numbers_are_left_out_and_told_of(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = "door,hall,attic,odd\n0,19.5,unknown,1\n1,20.5,7,0\n"
    found = read(tmp_path, text, Wanted((), (parse_condition("hall > 20"),)))
    assert shown(found) == {"door": "01", "hall>20": "01", "odd": "10"}
    assert caplog.messages[0].endswith("not asked for (--when reads them): attic")


def test_a_time_column_is_told_by_name(tmp_path: Path) -> None:
    text = "a,when,b\n0,Mon,1\n1,Tue,0\n"
    readings = read(tmp_path, text, Wanted(time="when"))
    assert shown(readings) == {"a": "01", "b": "10"}
    assert readings.moment(2) == "Tue"
    assert readings.moment(3) == ""
    assert read(tmp_path, "time,a\nMon,0\nTue,1\n").moment(1) == "Mon"
    assert "must have this column, got 'then'" in refused(
        tmp_path, text, Wanted(time="then")
    )


def test_sensors_are_chosen_and_numbers_compared(tmp_path: Path) -> None:
    text = "door,hall,attic,note\n0,19.5,1,x\n1,20.5,0,y\n1,21.5,,z\n0,20.5,1,\n"
    warm = parse_condition("hall > 21, off < 20")
    others = map(parse_condition, ("hall<20", "door changes", "door changes"))
    wanted = Wanted(("door", "at*"), (warm, *others))
    assert shown(read(tmp_path, text, wanted)) == {
        "door changes": "?101",
        "door": "0110",
        "hall>21": "0011",
        "hall<20": "1000",
        "attic": "10?1",
    }
    assert "must have this sensor, got 'cellar'" in refused(
        tmp_path, text, Wanted(("cellar",))
    )
    assert "must have this sensor (did you mean attic?), got 'atic'" in refused(
        tmp_path, text, Wanted((), (parse_condition("atic > 1"),))
    )
    assert "{}:2: note: must be a number" in refused(
        tmp_path, text, Wanted(("door",), (parse_condition("note > 1"),))
    )


@pytest.mark.parametrize(
    "text",
    [
        *("hall", "hall > warm", "> 3", "hall > 2, off < 3", "hall > 2, off > 1"),
        *("hall > 2 °C, off < 1 °F", "hall > 2 degrees C"),
    ],
)
def test_comparisons_that_say_nothing_are_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^when: must "):
        parse_condition(text)


def test_a_number_may_have_the_unit_that_was_told(tmp_path: Path) -> None:
    text = "hall\n20.5 °C\n22\n21.5°C\n20.9 °C\n"
    readings = read(tmp_path, text, Wanted((), (parse_condition("hall > 21 °C"),)))
    assert shown(readings) == {"hall>21°C": "0110"}
    warm = parse_condition("hall > 21 °C, off < 20.9 °C")
    assert shown(read(tmp_path, text, Wanted((), (warm,)))) == {"hall>21°C": "0111"}
    hot = parse_condition("hall > 21 °F")
    assert "must be a number, or one in °F" in refused(
        tmp_path, text, Wanted((), (hot,))
    )


def test_a_database_must_have_the_unit_that_was_told(tmp_path: Path) -> None:
    copy, entity = tmp_path / "home.db", "sensor.hall_temperature"
    shutil.copy(HOME, copy)

    def read_with(when: str) -> Readings:
        wanted = Wanted((), (parse_condition(f"{entity} {when}"),))
        return open_readings(str(copy), wanted)

    with pytest.raises(InvalidValueError, match=r"must be in °C, as --wh.* 'no unit'"):
        read_with("> 21 °C, off < 20")
    with closing(sqlite3.connect(copy)) as database:
        database.execute(
            "UPDATE state_attributes SET shared_attrs ="
            " json_set(shared_attrs, '$.unit_of_measurement', '°C')"
            " WHERE shared_attrs LIKE '%hall_temperature%'"
        )
        database.commit()
    told = shown(read_with("> 21 °C, off < 20"))
    assert told[f"{entity}>21°C"] == shown(read_with("> 21, off < 20"))[f"{entity}>21"]
    with pytest.raises(InvalidValueError, match="must be in °F, as --when says, got"):
        read_with("> 70 °F")


def test_a_log_gives_a_tick_for_each_change(tmp_path: Path) -> None:
    text = (
        "time,sensor,value\n"
        "2026-07-01T12:00:00Z,door,off\n"
        "2026-07-01T12:00:00Z,hall,off\n"
        "2026-07-01T14:00:05+02:00,hall,on\n"
        "2026-07-01 12:00:06,hall,on\n"
        "2026-07-01 12:00:07,door,on\n"
        "2026-07-01 12:00:07,door,off\n"
        "2026-07-01 12:00:08,hall,unavailable\n"
    )
    readings = read(tmp_path, text)
    assert shown(readings) == {"door": "00100", "hall": "0111?"}
    assert readings.moment(2) == "2026-07-01 12:00:05Z"
    assert readings.moment(4) == readings.moment(3) == "2026-07-01 12:00:07Z"


def test_a_log_keeps_what_its_signals_said_last_by_each_tick(tmp_path: Path) -> None:
    text = "1,level,55\n1,door,1\n2,level,57\n2,level,unknown\n3,door,0\n4,level,20\n"
    text += "5,level,21\n5,level,70\n6,level,71\n7,door,1\n8,level,1e300\n9,door,0\n"
    cuts = tuple(map(parse_condition, ("level > 50", "level > 60")))
    log = read(tmp_path, f"time,sensor,value\n{text}", Wanted(("door",), cuts))
    assert shown(log)["level>60"] == "0??0111"
    places = compared(map(log.wanted.every_condition().get, log.columns.sensorium))
    said = [numbers_in(each, places).get(2) for each in log.said]
    assert said == [55, None, None, 20, 70, 71, None]  # the last is too large


def test_logs_may_be_out_of_order_and_have_other_heads(tmp_path: Path) -> None:
    text = "entity_id,state,last_changed\nb,on,30\na,on,10\nb,off,20000000000000\n"
    readings = read(tmp_path, text)
    assert shown(readings) == {"a": "111", "b": "?10"}
    assert readings.moment(3) == "2603-10-11 11:33:20Z"


def test_a_bad_event_is_refused_with_its_line(tmp_path: Path) -> None:
    head = "time,sensor,value\n"
    assert refused(tmp_path, f"{head}1,door,on\n2,door,ajar\n") == (
        f"{{}}:3: door: {RULE}, got 'ajar'"
    )
    assert refused(tmp_path, f"{head}now,door,on\n") == (
        "{}:2: time: must be seconds since 1970, or a date such as 2026-07-01"
        " 12:00:00, got 'now'"
    )
    assert "must hold readings" in refused(tmp_path, head)


def test_a_database_that_home_assistant_made() -> None:
    readings = open_readings(str(HOME))
    names = [f"binary_sensor.{name}" for name in ("attic", "front_door", "hall_motion")]
    names += [f"binary_sensor.{name}" for name in ("window", "window_2")]
    assert list(readings.columns.sensorium) == names
    told = shown(readings)
    assert set(told[names[0]]) == {"?"}  # it was never available
    assert told[names[1]].count("01") == 26
    assert told[names[3]].count("01") == 30
    assert readings.moment(1) == "2025-06-15 15:06:40Z"
    assert "?" in told[names[2]]


@pytest.mark.parametrize(
    ("settings", "zone"),
    [
        (b'{"data": {"time_zone": "Europe/Berlin"}, "version": 1}', "Europe/Berlin"),
        (b'{"data": {}}', "UTC"),
        (b'{"data": {"time_z', "UTC"),
        (None, "UTC"),
    ],
)
def test_the_zone_of_a_home_is_in_the_settings_beside_its_database(
    settings: bytes | None, zone: str, tmp_path: Path
) -> None:
    database = tmp_path / "home-assistant_v2.db"
    database.write_bytes(HOME.read_bytes())
    if settings is not None:
        (tmp_path / ".storage").mkdir()
        (tmp_path / ".storage" / "core.config").write_bytes(settings)
    assert open_readings(str(database)).zone == zone


def test_other_entities_of_a_home_are_read_if_asked_for() -> None:
    warm = parse_condition("sensor.hall_temperature > 21, off < 20")
    readings = open_readings(str(HOME), Wanted(("switch.*",), (warm,)))
    told = shown(readings)
    assert set(told) == {"switch.heater", "sensor.hall_temperature>21"}
    # Warm from eight to twenty o'clock, on each of six days.
    assert told["sensor.hall_temperature>21"].lstrip("?").count("01") == 6
    said = [numbers_in(each, {0: 0}).get(0) for each in readings.said]
    for number, reads in zip(said, told["sensor.hall_temperature>21"], strict=True):
        limits = number is not None and {number > 21, number >= 20}
        assert reads == "?" if not limits else (reads == "1") in limits
    cut = open_readings(str(HOME), Wanted(("sensor.hall*",))).columns.sensorium.names
    assert [name.partition(">")[0] for name in cut] == ["sensor.hall_temperature"] * 3
    with pytest.raises(InvalidValueError, match="must have this sensor, got 'light"):
        open_readings(str(HOME), Wanted(("light.*",)))


def test_a_database_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "home.db"
    path.write_bytes(HOME.read_bytes())
    alone = shown(open_readings(str(path)))
    assert list(tmp_path.iterdir()) == [path]
    with sqlite3.connect(path) as writer:  # as Home Assistant has it, running
        writer.execute(
            "INSERT INTO states (metadata_id, state, last_updated_ts)"
            " SELECT metadata_id, 'on', 2e9 FROM states_meta"
            " WHERE entity_id = 'binary_sensor.attic'"
        )
        writer.commit()
        running = shown(open_readings(str(path)))
    writer.close()
    assert running["binary_sensor.attic"] == alone["binary_sensor.attic"] + "1"
    assert path.read_bytes()[:16] == HOME.read_bytes()[:16]


def test_parquet_with_gaps_and_dates(tmp_path: Path) -> None:
    path = tmp_path / "readings.parquet"
    dates = np.array(["2026-07-01T12:00", "2026-07-01T12:01"], "datetime64[ms]")
    table = {
        "at": pa.array(dates),
        "door": pa.array([True, None]),
        "hall": pa.array([19.0, 22.0]),
        "lamp": pa.array(["on", "off"]),
        "fan": pa.array([0, 1]),
    }
    pq.write_table(pa.table(table), path)
    wanted = Wanted(("door", "lamp", "fan"), (parse_condition("hall > 21"),))
    readings = open_readings(str(path), wanted)
    assert shown(readings) == {"door": "1?", "hall>21": "01", "lamp": "10", "fan": "01"}
    assert readings.moment(2) == "2026-07-01 12:01:00+00:00"
    assert shown(open_readings(str(path)))["hall>20"] == "01"
    with pytest.raises(InvalidValueError, match=r"parquet:1: hall: must be 0 or"):
        open_readings(str(path), Wanted(bins=0))
    log = {"time": [2.0, 1.0], "sensor": ["a", "b"], "value": [True, False]}
    pq.write_table(pa.table(log), path)
    assert shown(open_readings(str(path))) == {"a": "?1", "b": "00"}


def test_bytes_that_are_nothing_are_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.db"
    with closing(sqlite3.connect(other)) as database:
        database.execute("CREATE TABLE readings (x)")
    with pytest.raises(InvalidValueError, match="must be a database of Home Assistant"):
        open_readings(str(other))
    broken = written(tmp_path, b"PAR1nothing", "x.parquet")
    with pytest.raises(InvalidValueError, match=r"x\.parquet: must be a Parquet file"):
        open_readings(str(broken))


@pytest.mark.parametrize(
    ("times", "text"),
    [
        (None, "data: must say when each reading was"),
        (["20", "10"], "time: must not be before the one above it, got '10'"),
        (["noon", "10"], "time: must be seconds since 1970, or a date such as"),
    ],
)
def test_readings_without_times_or_out_of_order_are_refused(
    times: list[str] | None, text: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{text}"):
        seconds_of(Readings(Columns.of([[0], [1]], ["a"]), times))


def test_times_have_many_forms() -> None:
    times = ["2024-01-01 00:00:00Z", "2024-01-01T01:01:00+01:00", "1704067320"]
    columns = Columns.of([[0]] * 3, ["a"])
    found = seconds_of(Readings(columns, times)).tolist()
    assert found == [1704067200.0, 1704067260.0, 1704067320.0]


NOTHING = "door,motion\n0,1\n,\n1,1\nNA,unknown\n1,0\n"
"""The same, with rows that say nothing: they are no ticks."""


@pytest.mark.parametrize(
    ("name", "text"), [("readings.csv", NOTHING), ("readings.txt", README)]
)
def test_rows_come_out_in_order_whatever_seeds_and_actions_say(
    tmp_path: Path, name: str, text: str
) -> None:
    path = written(tmp_path, text, name)  # another ending is found: it exists
    source = open_source(str(path), seed=9)
    assert source.sensors == ("door", "motion")
    assert source.actions == ()
    assert source.length == 3
    for actions in (None, iter([-1, 5, 7])):
        assert everything(source, actions) == [[0, 1], [1, 1], [1, 0]]
        assert source.step(0) is None
    # Only the first row begins a trajectory.
    several = iter([source.first(), source.step(0), source.step(0)])
    assert [one.begins for one in several if one] == [True, False, False]


def test_a_run_has_the_sensors_it_asks_for_and_the_times_of_the_file(
    tmp_path: Path,
) -> None:
    rows = "2026-07-01 12:00,0,21.5,x;,1,19,x;2026-07-01 11:00,1,20.5,x;1e10,,22,x"
    text = f"time,door,hall,note;{rows};".replace(";", "\n")
    path = written(tmp_path, text)
    given = {"sensors": "d*", "when": "hall > 21, off < 20; hall > 20"}
    source = open_source(str(path), 0, given)
    assert source.sensors == ("door", "hall>21", "hall>20")
    seen = [source.first(), *(source.step(0) for _ in range(3))]
    assert [one.bits.tolist() for one in seen if one][2] == [True, False, True]
    noon = 1_782_907_200
    assert [one.at for one in seen if one] == [noon, noon, noon, 10**10]
    path.write_text("time,door\nMon,0\n")
    undated = FileSource(str(path))
    first = undated.first()
    assert (undated.undated, undated.zone, first and first.at) == ("Mon", None, 0)
    path.write_text("time,door\n1,0\nMon,1\n")
    with pytest.raises(InvalidValueError, match=r"^time: must be seconds since 1970"):
        open_source(str(path), 0)


def test_time_is_a_sensor_like_any_other_when_it_is_not_first(tmp_path: Path) -> None:
    source = open_source(str(written(tmp_path, "door,time\n0,1\n")), seed=0)
    assert source.sensors == ("door", "time")


NUMBER = f'{RULE} (or --when "b > NUMBER"; for a run, --set when=...)'
NO_UTF8 = "{}: must be UTF-8 text, got b'"
BLANK = "must not be blank before the end of the file, got ''"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *(
            (text, "{}: must have a header of sensor names, got 'no text'")
            for text in ("", "\n\n", "\ufeff")
        ),
        ("a,b\n", "{}: must hold readings, got 'none'"),
        ("a,b\n,\n", "{}: must hold readings, got 'none that is known'"),
        ("time\n1\n", "{}:1: must be a header of sensor names, got ['time']"),
        ("0,1\n1,1\n", "{}:1: must be a header of sensor names, got ['0', '1']"),
        ("a,,b\n0,1,1\n", "{}:1: sensor name: must not be empty, got ''"),
        ("a,b,a\n0,1,1\n", "{}:1: names: must be unique, got 'a'"),
        ("a,b*\n0,1\n", "{}:1: sensor name: must not end with *, got 'b*'"),
        ("a,b\n0,1\n0,2\n", f"{{}}:3: b: {NUMBER}, got '2'"),
        ("a,b\n0,1.5\n", f"{{}}:2: b: {NUMBER}, got '1.5'"),
        ("a,b\n0,１\n", f"{{}}:2: b: {RULE}, got '１'"),
        ("time,a,b\n0,1,x\n", f"{{}}:2: b: {RULE}, got 'x'"),
        ("a,b\n0;1\n", "{}:2: must have 2 cells, as many as the header, got 1"),
        ("a,b\n0,1\n0\n", "{}:3: must have 2 cells, as many as the header, got 1"),
        ("a,b\n0,1,\n", "{}:2: must have 2 cells, as many as the header, got 3"),
        ("a,b\n" + 898 * "0,1\n" + "0,7\n1,1\n", f"{{}}:900: b: {NUMBER}, got '7'"),
        ("a,b\n0,1\n\n\n0,1\n", f"{{}}:3: {BLANK}"),
        ("\na,b\n0,1\n", f"{{}}:1: {BLANK}"),
        ('a,b\n0,1\n0,"1\n', "{}:3: must be CSV, got 'unexpected end of data'"),
        ("Tür,b\n0,1\n".encode("latin-1"), NO_UTF8),
        (README.encode("utf-16"), NO_UTF8),
        (README.encode() + 999 * b"1,1\n" + b"\xff,1\n", NO_UTF8),
    ],
)
def test_a_bad_file_is_refused_with_row_and_column(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    path = written(tmp_path, text)
    with pytest.raises((InvalidValueError, ShapeError)) as caught:
        open_source(str(path), seed=0)
    said = str(caught.value)
    assert said.startswith(message.format(path))
    assert said == message.format(path) or isinstance(text, bytes)


def test_what_is_no_file_is_named(tmp_path: Path) -> None:
    zeros = written(tmp_path, "door\n0\n".encode("utf-16-le"), "zeros.csv")
    (tmp_path / "folder.csv").mkdir()
    for path, rule in (
        (zeros, r"zeros\.csv:1: "),
        (tmp_path / "none.csv", r"^source: must be a file that can be read \(No"),
        (tmp_path / "folder.csv", r"can be read \(Is a directory\).*folder\.csv"),
    ):
        with pytest.raises(InvalidValueError, match=rule):
            open_source(str(path), seed=0)


def test_changes_go_from_row_to_row_and_presence_is_of_messages(tmp_path: Path) -> None:
    wanted = Wanted(("level rises", "mode changes"))
    text = "level,mode\n1,a\n2,a\n2,b\n,b\n3,b\n"
    readings = read(tmp_path, text, wanted)
    assert readings.columns.sensorium.names == ("level rises", "mode changes")
    rows = [[*map(list, readings.columns.row(tick))] for tick in range(5)]
    assert rows == [
        [[False, False], [False, False]],
        [[True, False], [True, True]],
        [[False, True], [True, True]],
        [[False, False], [False, True]],
        [[False, False], [False, True]],
    ]
    with pytest.raises(InvalidValueError, match=r"^heard within: must be of mess"):
        read(tmp_path, text, Wanted(("mode heard within 5 s",)))
    named = read(tmp_path, "hall > 5,b\n1,0\n0,1\n", Wanted(("hall > 5",)))
    assert named.columns.sensorium.names == ("hall > 5",)
