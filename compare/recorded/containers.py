"""Files that hold several tables: TDMS, MDF4, HDF5 and MAT 7.3, MCAP, and spreadsheets.

Each group of channels, topic or sheet is a table, and a file's path names one after ``#``.  Headings have the units
that the file says.  Of a file only what is asked for is read: its columns one by one, a topic message by message.
"""

from __future__ import annotations

import importlib
import logging
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from datetime import date, datetime, time, timedelta
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from analytic.mechanism.one_line import count, shown
from compare.recorded.errors import DataError
from compare.recorded.formats import ColumnsByHeading, check_lengths, check_size, reader, seconds, unreadable
from compare.recorded.headings import clocklike, unit_of
from compare.recorded.text import MIN_ROWS

if TYPE_CHECKING:
    import h5py
    from mcap.reader import McapReader

NAMED = 8  # tables that a message names, at most
WIDEST = 64  # columns of a matrix that are headings of their own
DEEPEST = 8  # fields within fields of a ROS message
MAT_CLASSES = {"char": "holds text and no numbers", "cell": "is a cell array and no vector"}
ROS_UNITS = {  # of what REP 103 gives a unit, by the name of a field
    "angular_velocity": "rad/s",
    "linear_acceleration": "m/s^2",
    "force": "N",
    "torque": "N.m",
    "linear": "SI",
    "angular": "SI",
}
ROS_JOINT_STATE = "sensor_msgs/msg/JointState"
EPOCH = datetime(1900, 1, 1)  # from which a spreadsheet's moments are counted; only their differences are used


@dataclass(frozen=True)
class Part(Mapping[str, "np.ndarray | str"]):
    """A table of a file that is open: how many rows each heading has, and what reads its numbers (N,), or says why it
    has none.
    """

    name: str
    sizes: Mapping[str, int]
    read: Callable[[str], np.ndarray | str]

    def __getitem__(self, heading: str) -> np.ndarray | str:
        return self.read(heading)

    def __iter__(self) -> Iterator[str]:
        return iter(self.sizes)

    def __len__(self) -> int:
        return len(self.sizes)

    @property
    def rows(self) -> int:
        """Of its longest column."""
        return max(self.sizes.values(), default=0)


Parts: TypeAlias = "Callable[[Path, ExitStack], Sequence[Part]]"


@contextmanager
def opened(source: Path) -> Iterator[Path | ColumnsByHeading]:
    """A data file's columns by heading, or the path of its text.  Raises DataError."""
    file, pick = parted(source)
    kind = next((each for each in KINDS if file.suffix.lower() in each.suffixes), None)
    read = reader(file)
    if pick and (read is not None or kind is None):
        raise DataError(f"{file.name}: has one table, and {shown(pick)} is asked for; leave '#{pick}' out of its path")
    if kind is None and read is None:
        yield file
    elif kind is None or (file.suffix.lower() == ".mat" and not _is_hdf5(file)):
        assert read is not None
        yield read(file)
    else:
        with ExitStack() as stack:
            try:
                found = _picked(file, pick, kind.parts(file, stack), kind.what)
                table = _as_text(found, file, stack) if isinstance(found, Sheet) else _guarded(found, file, kind.name)
            except DataError:
                raise
            except Exception as error:  # noqa: BLE001 - readers of damaged files raise whatever they come upon
                raise unreadable(file, kind.name, error) from None
            yield table


def _guarded(part: Part, file: Path, kind: str) -> Part:
    """A table whose reader's faults are ours."""

    def read(heading: str) -> np.ndarray | str:
        try:
            return part.read(heading)
        except DataError:
            raise
        except Exception as error:  # noqa: BLE001 - as above
            raise unreadable(file, kind, error) from None

    return replace(part, read=read)


def parted(source: Path) -> tuple[Path, str]:
    """The file of a path, and the table of it that the path names after '#'."""
    if source.exists() or "#" not in str(source):
        return source, ""
    file, _, pick = str(source).partition("#")
    return Path(file), pick


def chosen(name: str, columns: ColumnsByHeading, headings: Sequence[str]) -> ColumnsByHeading:
    """Some columns of a file.  Raises DataError where they are too long, or of several lengths."""
    if isinstance(columns, Part):
        check_size(name, max((columns.sizes[each] for each in headings), default=0), len(headings))
    some = {heading: columns[heading] for heading in headings}
    check_lengths(name, some)
    return some


def _picked(file: Path, pick: str, parts: Sequence[Part], what: str) -> Part:
    """The table that is meant: the one that is named, or counted from 1, or the only one that may be meant."""
    named = [part for part in parts if part.name == pick] or [p for p in parts if p.name.strip("/") == pick.strip("/")]
    if pick and len(named) == 1:
        return named[0]
    if pick.isdigit() and 1 <= int(pick) <= len(parts):
        return parts[int(pick) - 1]
    likely = [part for part in parts if len(part) > 1 and part.rows >= MIN_ROWS] or list(parts)
    if not pick and len(likely) == 1:
        return likely[0]
    if not parts:
        raise DataError(f"{file.name}: has no {what} with numbers in it; give a file that has, or save it as CSV")
    each = [f"{shown(p.name)} ({count(len(p), 'column')}, {count(p.rows, 'row')})" for p in likely]
    more = f" and {len(each) - NAMED} more" if len(each) > NAMED else ""
    asked = f"{shown(pick)} is {'not the only' if named else 'no'} {what} of it; there" if pick else "there"
    first = likely[0].name
    line = f"{file.name}#{first if [p.name for p in parts].count(first) == 1 else 1 + parts.index(likely[0])}"
    raise DataError(
        f"{file.name}: {asked} are {', '.join(each[:NAMED])}{more}; say which in its path, such as {shown(line)}"
    )


def _needs(file: Path, package: str, extra: str, *modules: str) -> ModuleType:
    """A package that reads a file.  Raises DataError where it is missing."""
    try:
        first, *_ = [importlib.import_module(module) for module in modules]
    except ImportError:
        raise DataError(
            f"{file.name}: is read by {package}, which is not installed; run: pip install"
            f" 'linkage-crosscheck[{extra}]', or save it as CSV"
        ) from None
    return first


def _headed(name: object, unit: object) -> str:
    """A heading with its unit."""
    heading = " ".join(str(name).split())
    unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
    written = re.sub(r"[\[\]()]", "", str(unit)).strip() if isinstance(unit, str | np.str_) else ""
    return heading if not written or unit_of(heading) else f"{heading} [{written}]"


def _numbers(values: np.ndarray) -> np.ndarray | str:
    """What is read as numbers (N,), moments as seconds after the first; or why it is none."""
    values = np.asarray(values)
    if values.ndim == 2 and 1 in values.shape:
        values = values.reshape(-1)
    if values.ndim != 1:
        return "is no vector of real numbers"
    if values.dtype.kind in "mM":
        return seconds(values)
    return values.astype(float) if values.dtype.kind in "iufb" else f"holds {values.dtype} and no numbers"


# ---------------------------------------------------------------- TDMS


def _tdms(file: Path, stack: ExitStack) -> Sequence[Part]:
    nptdms = _needs(file, "npTDMS", "tdms", "nptdms")
    logging.getLogger("nptdms").setLevel(logging.ERROR)  # a file that was cut off is read as far as it goes
    tdms = stack.enter_context(nptdms.TdmsFile.open(stack.enter_context(file.open("rb"))))
    parts = []
    for group in tdms.groups():
        channels = {}
        for channel in group.channels():
            stamps = np.dtype(channel.dtype).kind == "M" if channel.dtype is not None else False
            unit = "s" if stamps else channel.properties.get("unit_string", "")
            channels[_headed(channel.name, unit)] = channel
        if not channels:
            continue
        timed = [c for c in channels.values() if "wf_increment" in c.properties and len(c)]
        clock = timed[0] if timed and not any(map(clocklike, channels)) else None
        sizes = {"time [s]": len(clock)} if clock is not None else {}
        sizes |= {heading: len(channel) for heading, channel in channels.items()}

        def read(heading: str, channels: Mapping = channels, clock: object = clock) -> np.ndarray | str:
            if heading not in channels:
                return np.asarray(clock.time_track(), float)  # type: ignore[attr-defined]  # where there is one
            return _numbers(channels[heading][:])

        parts.append(Part(group.name, sizes, read))
    return parts


# ---------------------------------------------------------------- MDF4


def _mdf(file: Path, stack: ExitStack) -> Sequence[Part]:
    asammdf = _needs(file, "asammdf", "mdf", "asammdf")
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what it says of a damaged file is raised as well
    with suppress(AttributeError):
        del importlib.import_module("asammdf.blocks.mdf_v4").MDF4.__del__  # of a damaged file it raises another fault
    mdf = asammdf.MDF(stack.enter_context(file.open("rb")))
    stack.callback(mdf.close)
    parts = []
    for k, group in enumerate(mdf.groups):
        indices: dict[str, int] = {}
        clocks = [k for k in (mdf.masters_db.get(k),) if k is not None]
        for index in [*clocks, *(i for i in range(len(group.channels)) if i not in clocks)]:
            heading = _headed(group.channels[index].name, mdf.get_channel_unit(group=k, index=index))
            if heading in indices:
                raise DataError(f"{file.name}: group {k + 1} has {shown(heading)} twice; rename one of the channels")
            indices[heading] = index
        rows = group.channel_group.cycles_nr

        def read(heading: str, k: int = k, indices: Mapping[str, int] = indices) -> np.ndarray | str:
            return _numbers(mdf.get(group=k, index=indices[heading]).samples)

        parts.append(Part(group.channel_group.acq_name or f"group {k + 1}", dict.fromkeys(indices, rows), read))
    return parts


# ---------------------------------------------------------------- HDF5, MAT 7.3


def _is_hdf5(file: Path) -> bool:
    """Whether a MAT file is of version 7.3; its first 512 bytes are MATLAB's."""
    with file.open("rb") as stream:
        head = stream.read(520)
    return head[512:520] == b"\x89HDF\r\n\x1a\n" or head[:8] == b"\x89HDF\r\n\x1a\n"


def _hdf5(file: Path, stack: ExitStack) -> Sequence[Part]:
    h5py = _needs(file, "h5py", "hdf5", "h5py")
    root = stack.enter_context(h5py.File(file, "r"))
    return list(_of_group(root))


def _of_group(group: h5py.Group) -> Iterator[Part]:
    """The tables in a group of an HDF5 file: its vectors, and each of its tables, matrices and groups."""
    vectors: dict[str, h5py.Dataset] = {}
    for name in group:
        item: Any = group.get(name) if not str(name).startswith("#") else None  # '#refs#' is MATLAB's own
        if hasattr(item, "keys"):
            yield from _of_group(item)
        elif not getattr(item, "shape", None):
            continue  # a number, a link that leads nowhere, a type
        elif item.dtype.names:
            yield _records(item)
        elif len(item.shape) == 2 and min(item.shape) > 1:
            yield _of_matrix(item)
        else:
            vectors[_headed(name, _unit(item.attrs))] = item
    if vectors:
        sizes = {heading: max(data.shape) for heading, data in vectors.items()}
        yield Part(str(group.name), sizes, lambda heading: _dataset(vectors[heading], ...))


def _unit(attributes: Mapping[str, object]) -> object:
    return next((attributes[key] for key in ("units", "unit", "Units", "Unit") if key in attributes), "")


def _records(data: h5py.Dataset) -> Part:
    """A table of records, as pandas and PyTables write them."""
    fields = {str(name): str(name) for name in data.dtype.names}
    rows = data.shape[0] if data.shape else 0
    return Part(str(data.name), dict.fromkeys(fields, rows), lambda heading: _dataset(data, fields[heading]))


def _of_matrix(data: h5py.Dataset) -> Part:
    """A table of a matrix, whose columns are called by its ``columns`` attribute or counted from 1; as MATLAB writes
    one, its columns are the rows here.
    """
    turned = "MATLAB_class" in data.attrs
    rows, wide = data.shape[::-1] if turned else data.shape
    named = np.ravel(data.attrs.get("columns", []))
    names = [each.decode() if isinstance(each, bytes) else str(each) for each in named]
    short = str(data.name).rpartition("/")[2]
    names = names if len(names) == wide else [f"{short}_{k + 1}" for k in range(min(wide, WIDEST))]
    places = {name: (slice(None), k)[:: -1 if turned else 1] for k, name in enumerate(names)}
    return Part(str(data.name), dict.fromkeys(places, rows), lambda heading: _dataset(data, places[heading]))


def _dataset(data: h5py.Dataset, which: object) -> np.ndarray | str:
    """Numbers (N,) of a dataset, or of a field or a column of it."""
    kind = data.attrs.get("MATLAB_class", b"")
    why = MAT_CLASSES.get(kind.decode() if isinstance(kind, bytes) else str(kind))
    if why is not None or (data.dtype.kind not in "iufb" and not data.dtype.names):
        return why or f"holds {data.dtype} and no numbers"
    return _numbers(data[which])


# ---------------------------------------------------------------- MCAP


def _mcap(file: Path, stack: ExitStack) -> Sequence[Part]:
    _needs(file, "mcap-ros2-support", "mcap", "mcap", "mcap_ros2")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    stream = stack.enter_context(file.open("rb"))
    bag = make_reader(stream, decoder_factories=[DecoderFactory()])
    summary = bag.get_summary()
    if summary is None or summary.statistics is None:
        raise DataError(f"{file.name}: has no summary: its recording was cut off; run: mcap recover {file.name}")
    counts = {summary.channels[k].topic: n for k, n in summary.statistics.channel_message_counts.items()}
    schemas = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values() if c.schema_id}
    parts = []
    for topic, messages in counts.items():
        schema = schemas.get(topic)
        if not messages or schema is None or not schema.encoding.startswith("ros2"):
            continue
        first = next(iter(bag.iter_decoded_messages(topics=[topic]))).decoded_message
        headings = ["time [s]", *_fields(first, schema.name)]
        if len(headings) > 1:
            read = _Topic(bag, topic, schema.name, messages)
            parts.append(Part(topic, dict.fromkeys(headings, messages), read))
    return parts


@dataclass
class _Topic:
    """What reads a topic, once, for its first column."""

    bag: McapReader
    topic: str
    kind: str
    messages: int
    columns: ColumnsByHeading = field(default_factory=dict)

    def __call__(self, heading: str) -> np.ndarray | str:
        if not self.columns:
            self.columns = _messages(self.bag.iter_decoded_messages(topics=[self.topic]), self.kind, self.messages)
        return self.columns[heading]


def _messages(messages: Iterator, kind: str, rows: int) -> ColumnsByHeading:
    """The columns of a topic, whose clock is that of its headers or, without, of the recording."""
    stamps, columns = np.full(rows, np.nan), dict[str, np.ndarray]()
    first: int | None = None
    for row, each in enumerate(messages):
        message = each.decoded_message
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        at = stamp.sec * 10**9 + stamp.nanosec if stamp is not None else 0
        at = at or each.message.log_time
        first = at if first is None else first
        stamps[row] = (at - first) * 1e-9
        for heading, value in _fields(message, kind).items():
            columns.setdefault(heading, np.full(rows, np.nan))[row] = value
    return {"time [s]": stamps, **columns}


def _fields(message: object, kind: str) -> dict[str, float]:
    """The numbers of a ROS message by heading; of joint states by joint, in the SI unit of whatever they are."""
    if kind == ROS_JOINT_STATE:
        return {
            f"{what}_{joint} [SI]": float(value)
            for what in ("position", "velocity", "effort")
            for joint, value in zip(message.name, getattr(message, what), strict=False)  # type: ignore[attr-defined]
        }
    return dict(_flat(message, "", "", 0))


def _flat(value: object, name: str, unit: str, depth: int) -> Iterator[tuple[str, float]]:
    if isinstance(value, bool | int | float):
        yield _headed(name, unit), float(value)
    elif isinstance(value, list | tuple | np.ndarray) and len(value) <= WIDEST and depth < DEEPEST:
        for k, each in enumerate(value):
            yield from _flat(each, f"{name}_{k + 1}", unit, depth + 1)
    elif hasattr(value, "__slots__") and depth < DEEPEST:
        for field in (each for each in value.__slots__ if each not in ("header", "_type", "_full_text")):
            inside = f"{name}.{field}" if name else field
            yield from _flat(getattr(value, field), inside, ROS_UNITS.get(field, unit), depth + 1)


# ---------------------------------------------------------------- spreadsheets


@dataclass(frozen=True)
class Sheet(Part):
    """A sheet, which is read as text of its rows."""

    rows_of: Callable[[], list[list[object]]]


def _sheets(file: Path, stack: ExitStack) -> Sequence[Part]:
    calamine = _needs(file, "python-calamine", "xlsx", "python_calamine")
    book = stack.enter_context(calamine.CalamineWorkbook.from_path(str(file)))
    parts = []
    for name in book.sheet_names:
        sheet = book.get_sheet_by_name(name)
        if sheet.end is not None:
            wide = dict.fromkeys(map(str, range(sheet.total_width)), sheet.total_height)
            parts.append(Sheet(name, wide, str, partial(sheet.to_python, skip_empty_area=False)))
    return parts


def _as_text(sheet: Sheet, file: Path, stack: ExitStack) -> Path:
    """The rows of a sheet as a file of text, line by line, separated by tabs."""
    check_size(file.name, sheet.rows, len(sheet))
    rows = sheet.rows_of()
    first: dict[int, datetime] = {}  # moments of each column that has them
    titles: dict[int, tuple[int, int]] = {}  # the last text above them
    for k, row in enumerate(rows):
        for place, cell in enumerate(row):
            if isinstance(cell, date | time):
                first.setdefault(place, _moment(cell))
            elif isinstance(cell, str) and cell.strip() and place not in first:
                titles[place] = (k, place)
    dated = {titles[place] for place in first if place in titles and not unit_of(str(rows[titles[place][0]][place]))}
    text = Path(stack.enter_context(TemporaryDirectory())) / file.name
    with text.open("w", encoding="utf-8") as lines:
        for k, row in enumerate(rows):
            cells = [_cell(cell, first.get(p)) + " [s]" * ((k, p) in dated) for p, cell in enumerate(row)]
            lines.write("\t".join(cells) + "\n" if any(cells) else "\n")
    return text


def _moment(cell: date | time) -> datetime:
    if isinstance(cell, time):
        return datetime.combine(EPOCH, cell)
    return cell if isinstance(cell, datetime) else datetime.combine(cell, time())


def _cell(cell: object, first: datetime | None) -> str:
    """A cell as text; a moment in seconds after the first of its column."""
    if isinstance(cell, date | time):
        return repr((_moment(cell) - (first or EPOCH)).total_seconds())
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    return repr(float(cell)) if isinstance(cell, int | float) else re.sub(r"\s+", " ", str(cell))


@dataclass(frozen=True)
class Kind:
    """Files of several tables: their name with its article, what a table is called, and what lists them."""

    name: str
    suffixes: tuple[str, ...]
    what: str
    parts: Parts


KINDS = (
    Kind("a TDMS", (".tdms",), "group", _tdms),
    Kind("an MDF", (".mf4", ".mdf"), "group", _mdf),
    Kind("an HDF5", (".h5", ".hdf5", ".hdf", ".mat"), "group", _hdf5),
    Kind("an MCAP", (".mcap",), "topic", _mcap),
    Kind("a spreadsheet", (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"), "sheet", _sheets),
)
