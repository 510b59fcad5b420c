"""Texts of dates: each form against the datetime of Python, and forms that are refused by name."""

import datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fvsolve.parts.date_keys import ORDERS
from fvsolve.parts.time_stamps import Stamp, StampError, StartTime, read_stamp

INSTANTS = st.datetimes(datetime.datetime(1900, 1, 1), datetime.datetime(2200, 1, 1))
OFFSETS = st.sampled_from([None, 0, 60, -330, 840])  # [min]
SEPTEMBER = datetime.datetime(2026, 9, 4, 17, 5, 6)
FORMS = {
    "%Y-%m-%dT%H:%M:%S": None,
    "%Y-%m-%d %H:%M:%S": None,
    "%Y/%m/%d %H:%M:%S": None,
    "%Y.%m.%d %H:%M:%S": None,
    "%Y%m%dT%H%M%S": None,
    "%d.%m.%Y %H:%M:%S": None,
    "%d %b %Y %H:%M:%S": None,
    "%d-%B-%Y %H:%M:%S": None,
    "%b %d, %Y %I:%M:%S %p": None,
    "%Y-%m-%d %I:%M:%S%p": None,
    "%d/%m/%Y %H:%M:%S": ORDERS[0],
    "%m/%d/%Y %H:%M:%S": ORDERS[1],
    "%d-%m-%Y %H:%M:%S": ORDERS[0],
    "%m-%d-%Y %I:%M:%S %p": ORDERS[1],
}


def seconds(moment: datetime.datetime) -> float:
    """Seconds from 1970 of a datetime in UTC."""
    return moment.replace(tzinfo=datetime.UTC).timestamp()


@pytest.mark.parametrize("form", FORMS)
def test_each_form_gives_the_instant_that_python_formats(form):
    assert read_stamp(SEPTEMBER.strftime(form), FORMS[form]) == Stamp(int(seconds(SEPTEMBER)))


@given(INSTANTS, OFFSETS)
def test_iso_texts_of_python_are_read_to_the_microsecond_and_written_again(moment, offset):
    zone = None if offset is None else datetime.timezone(datetime.timedelta(minutes=offset))
    text = moment.replace(tzinfo=zone).isoformat()
    found = read_stamp(text)
    since = moment - datetime.datetime(1970, 1, 1) - datetime.timedelta(minutes=offset or 0)
    assert found.exact * 10**6 == since // datetime.timedelta(microseconds=1)
    assert read_stamp(str(found)) == found


@given(INSTANTS, OFFSETS, st.floats(-1e6, 1e9))
def test_dates_of_results_are_those_of_numpy(moment, offset, t):
    zone = None if offset is None else datetime.timezone(datetime.timedelta(minutes=offset))
    start = StartTime(read_stamp(moment.replace(tzinfo=zone).isoformat()))
    expected = np.datetime64(moment) + np.timedelta64(round(t * 1e6), "us")
    assert start.datetimes([t])[0] == expected
    [text] = start.texts([t])
    assert abs(start.seconds(read_stamp(text)) - t) <= 1e-6


@pytest.mark.parametrize(
    "text, message",
    [
        ("01/02/2026 06:00", '"01/02/2026" is ambiguous; expected the key `date_order`'),
        ("13/02/2026", '"13/02/2026" is ambiguous'),  # so a file stays valid when its first rows go
        ("01-02-2026", "ambiguous"),
        ("2026-02-30", '"2026-02-30" is not a day of the calendar'),
        ("30.02.2026", "not a day of the calendar"),
        ("1 Mai 2026", '"Mai" is not the English name of a month'),
        ("2026-03-01 25:00", "is not a time of the day"),
        ("2026-03-01 23:59:60", "is not a time of the day"),
        ("2026-03-01 13:00 PM", "the hour before AM or PM is not from 1 to 12"),
        ("2026-03-01 06:00 CET", "is not a date"),
        ("2026-03-01 06:00+25:00", "is not an offset from UTC"),
        ("01.03.26", "is not a date"),
        ("06:00", "is not a date"),
    ],
)
def test_other_texts_are_refused_by_name(text, message):
    with pytest.raises(StampError) as caught:
        read_stamp(text)
    assert message in str(caught.value) and "; expected" in str(caught.value)


def test_a_day_may_end_at_24():
    assert read_stamp("2026-12-31 24:00") == read_stamp("2027-01-01 00:00")
