"""Changes in the state of a home's sensors between two reports."""

from neurosnap.health.alarm import Alarm, AlarmProgress, Newsreader, Standing, news


def alarm(sensor: str, step: int, kind: str = "silent") -> Alarm:
    at = 600.0 * (step + 1)
    return Alarm("UTC", sensor, kind, at - 6000, at, 0.01, "why", "else")


def standing(step: int, *alarms: Alarm, known: int = 2) -> Standing:
    return Standing(600.0 * step, AlarmProgress(50, 60, known, 3), alarms)


def test_an_alarm_is_news_once_and_so_is_its_end() -> None:
    hall = alarm("hall", 10)
    (begun,) = news(standing(10), standing(11, hall))
    assert (begun.sensor, begun.at, begun.alarm) == ("hall", 6600.0, hall)
    assert begun.line() == f"Thu 01 Jan 1970 01:50 UTC  {hall.line()}"
    assert not list(news(standing(11, hall), standing(12, hall)))
    (ended,) = news(standing(12, hall), standing(13))
    assert ended.alarm is None
    assert ended.line() == "Thu 01 Jan 1970 02:10 UTC  hall: alarm over"


def test_an_alarm_that_becomes_another_is_one_more() -> None:
    less, silent = alarm("hall", 10, "less"), alarm("hall", 20)
    (said,) = news(standing(12, less), standing(21, silent))
    assert said.alarm == silent


def test_to_whom_nothing_was_known_all_that_is_in_force_is_news() -> None:
    hall = alarm("hall", 10)
    assert [each.alarm for each in news(None, standing(30, hall))] == [hall]


def test_a_reader_tells_nothing_again_that_was_in_force_before_it_came() -> None:
    hall, door = alarm("hall", 10), alarm("door", 12)
    reader = Newsreader()
    progress = "learning: 50 of about 60 changes; 2 of 3 sensors known"
    assert list(reader.lines(standing(11, hall))) == [progress]
    (line,) = reader.lines(standing(13, hall, door))
    assert "  door: why; " in line
    (line,) = reader.lines(standing(20, door))
    assert line.endswith("  hall: alarm over")
    assert list(reader.lines(standing(21, door))) == []
    (line,) = reader.lines(standing(22, door, known=3))
    assert line.endswith("; 3 of 3 sensors known")
    assert reader.last == standing(22, door, known=3)
