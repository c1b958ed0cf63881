"""`DeviceClock`: a device's own time on the SYNC time base, with its uncertainty.

A device stamps its rows with its own clock, which has an offset and a rate error of some parts per
million. There are three sources for the clock:
- Arrivals of rows. Rows arrive late, never early. Therefore the straight line that touches all
  arrivals from below is the clock plus the shortest transmission delay. Arrivals do not show this
  delay (theory: section 8 estimates it on the bins).
- Marks: requests that the device answers with its time. They bound the clock from both sides.
- Edges of a wired trigger. They measure the clock directly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray, freeze, read_only
from config.errors import DataQualityError

LARGEST_RATE_ERROR = 2e-3
BISECTIONS = 80
SUBSETS = 8
STRETCHES = 256
SLOWEST_GROWTH = 1.15
FEWEST_ARRIVALS = 64
FEWEST_MARKS = 3
OUTLIER_SIGMAS = 6.0

Method = Literal["arrivals", "marks", "edges"]


@dataclass(frozen=True, eq=False)
class DeviceClock:
    """SYNC time = sync_s + rate (device time - device_s), for one run.

    Attributes:
        device_s, sync_s: The same instant on both clocks, in the middle of the data [s].
        rate: SYNC seconds per second of the device.
        covariance: Shape (2, 2). Covariance of `sync_s` and `rate`.
        wander_s: RMS deviation of the device's clock from the straight line [s].
        method: Source of the clock. With arrivals, the clock contains the shortest transmission
            delay.
    """

    device_s: float
    sync_s: float
    rate: float
    covariance: FloatArray
    wander_s: float
    method: Method

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (2, 2), "covariance", what="clock ")
        if not abs(self.rate - 1.0) < LARGEST_RATE_ERROR:
            raise DataQualityError(
                f"the device's clock would be off by {self.drift_ppm:.0f} ppm, which is"
                " impossible for a quartz: check the unit of its time stamps",
                code="RID-PLATE-CLOCK",
            )

    @property
    def drift_ppm(self) -> float:
        """Amount by which the device's clock is slow [ppm]."""
        return 1e6 * (self.rate - 1.0)

    def to_sync(self, device_s: FloatArray) -> FloatArray:
        """Return SYNC times of device times [s]."""
        return np.asarray(self.sync_s + self.rate * (np.asarray(device_s) - self.device_s))

    def sigma_s(self, device_s: FloatArray) -> FloatArray:
        """Return the standard deviation of `to_sync` at some device times [s]."""
        since = np.asarray(device_s) - self.device_s
        (offset, cross), (_, rate) = self.covariance
        variance = offset + 2.0 * cross * since + rate * since**2
        return np.asarray(np.sqrt(np.maximum(variance, 0.0) + self.wander_s**2))


def clock_from_arrivals(
    device_s: FloatArray, arrival_s: FloatArray, *, shortest_delay_s: float = 0.0
) -> DeviceClock:
    """Fit a clock to rows that the device stamped and that arrived later.

    The clock is the straight line below all arrivals that is nearest to them on average: a linear
    programme in two variables. The uncertainty is estimated from the same fit to eighths of the
    reads, and then reduced, because the whole run has eight times as many reads.

    Args:
        device_s, arrival_s: Shape (rows,). Device time of each row, and SYNC time of its read [s].
            Rows of the same read have the same arrival.
        shortest_delay_s: Shortest transmission time of a row: its bits at the line's bit rate [s].

    Raises:
        DataQualityError: There are too few rows, or the result is impossible for a quartz clock.
    """
    device = read_only("device time", device_s, float, (None,), DataQualityError)
    arrival = read_only("arrival", arrival_s, float, device.shape, DataQualityError)
    chunk = np.concatenate([[0], np.cumsum(np.diff(arrival) != 0.0)]) if len(arrival) else device
    if len(device) == 0 or chunk[-1] + 1 < FEWEST_ARRIVALS:
        raise DataQualityError(
            f"{len(device)} rows of the device in {int(chunk[-1]) + 1 if len(device) else 0}"
            f" reads are too few for its clock: at least {FEWEST_ARRIVALS} reads are needed",
            code="RID-PLATE-CLOCK",
        )
    middle = float(device.mean())
    x, late = device - middle, arrival - shortest_delay_s - device
    offset, rate = _line_under(x, late)
    # Delays of neighbouring reads are correlated, so each subset consists of sections and not of
    # single reads.
    stretch = chunk * min(STRETCHES, chunk[-1] + 1) // (chunk[-1] + 1)
    line = np.array([offset, rate])
    eighths = np.array([_line_under(x[k], late[k]) for k in _deal(stretch, SUBSETS)]) - line
    halves = np.array([_line_under(x[k], late[k]) for k in _deal(stretch, 2)]) - line
    gain = _gain(float(halves[:, 0].mean()), float(eighths[:, 0].mean()))
    covariance = eighths.T @ eighths / SUBSETS / gain**2
    wander_s = _wander(x, late - offset - rate * x, float(np.mean(eighths[:, 0] ** 2)))
    return DeviceClock(
        middle, middle + offset, 1.0 + rate, _regular(covariance, x), wander_s, "arrivals"
    )


def clock_from_marks(
    sent_s: FloatArray, device_s: FloatArray, received_s: FloatArray
) -> DeviceClock:
    """Fit a clock to requests that the device answered with its time.

    The device read its time between request and answer. The clock is midway between the highest and
    the lowest possible straight line. Half the distance of these lines bounds the error, however
    the delays of request and answer differ.

    Args:
        sent_s, received_s: Shape (marks,). SYNC times of each request's last bit and of each
            answer's arrival [s].
        device_s: Shape (marks,). Times in the answers [s].

    Raises:
        DataQualityError: There are too few marks, an answer precedes its request, or no line fits.
    """
    device = read_only("mark", device_s, float, (None,), DataQualityError)
    sent = read_only("mark sent", sent_s, float, device.shape, DataQualityError)
    received = read_only("mark received", received_s, float, device.shape, DataQualityError)
    if len(device) < FEWEST_MARKS or np.any(received <= sent) or np.ptp(device) <= 0.0:
        raise DataQualityError(
            f"{len(device)} marks do not determine a clock: at least {FEWEST_MARKS} marks at"
            " different times are needed, each answered after it was sent",
            code="RID-PLATE-CLOCK",
        )
    middle = float((device.min() + device.max()) / 2.0)
    x = device - middle
    high = np.array(_line_under(x, received - device))
    low = -np.array(_line_under(x, device - sent))
    ends = np.array([x.min(), x.max()])
    half = (high[0] - low[0] + ends * (high[1] - low[1])) / 2.0
    if half.min() < 0.0:
        raise DataQualityError(
            f"no clock of constant rate fits the requests and answers of the marks (error of"
            f" {-1e6 * half.min():.0f} us): the device's clock was set or restarted during the run",
            code="RID-PLATE-CLOCK",
        )
    offset, rate = (high + low) / 2.0
    # Assumption: the errors at the two ends are independent and uniformly distributed within their
    # bounds.
    to_line = np.linalg.inv(np.column_stack([np.ones(2), ends]))
    covariance = to_line @ np.diag(half**2 / 3.0) @ to_line.T
    return DeviceClock(middle, middle + float(offset), 1.0 + float(rate), covariance, 0.0, "marks")


def clock_from_edges(device_s: FloatArray, sync_s: FloatArray) -> DeviceClock:
    """Fit a clock to edges of a wired trigger, which give device times of known SYNC times.

    Args:
        device_s, sync_s: Shape (edges,). Device time and SYNC time of each edge, paired by
            `match_edges` [s].

    Raises:
        DataQualityError: There are too few edges, or the result is impossible for a quartz clock.
    """
    device = read_only("edge", device_s, float, (None,), DataQualityError)
    sync = read_only("edge's SYNC", sync_s, float, device.shape, DataQualityError)
    if len(device) < FEWEST_MARKS or np.ptp(device) <= 0.0:
        raise DataQualityError(
            f"{len(device)} trigger edges are too few for a clock: at least {FEWEST_MARKS} at"
            " different times are needed. Check the trigger's wire",
            code="RID-PLATE-CLOCK",
        )
    middle = float(device.mean())
    x, late = device - middle, sync - device
    use = np.ones(len(device), dtype=np.bool_)
    for _ in range(2):  # repeat the fit without the cycles whose SYNC was delayed
        rest = late - np.polyval(np.polyfit(x[use], late[use], 1), x)
        spread = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
        kept = np.abs(rest) <= OUTLIER_SIGMAS * spread + 1e-9
        use = kept if kept.sum() >= FEWEST_MARKS else use
    columns = np.column_stack([np.ones(int(use.sum())), x[use]])
    line = np.linalg.lstsq(columns, late[use], rcond=None)[0]
    rest = late[use] - columns @ line
    variance = float(np.sum(rest**2)) / max(len(rest) - 2, 1)
    covariance = np.asarray(variance * np.linalg.inv(columns.T @ columns), dtype=np.float64)
    wander_s = _wander_of_means(x[use], rest, variance)
    return DeviceClock(
        middle, middle + float(line[0]), 1.0 + float(line[1]), covariance, wander_s, "edges"
    )


def match_edges(
    device_s: FloatArray, sync_s: FloatArray, coarse: DeviceClock, *, within_s: float
) -> tuple[IntArray, IntArray]:
    """Pair trigger edges with SYNC times by a coarse clock, such as one from arrivals.

    Args:
        device_s: Shape (edges,). Device times of the edges [s].
        sync_s: Shape (cycles,). SYNC times, increasing [s].
        coarse: A clock accurate to less than half a cycle.
        within_s: Largest distance of an edge from a SYNC; edges further away are glitches [s].

    Returns:
        `edges, cycles`. Indices of the pairs.
    """
    at = coarse.to_sync(device_s)
    right = np.clip(np.searchsorted(sync_s, at), 1, len(sync_s) - 1)
    nearest = np.where(at - sync_s[right - 1] < sync_s[right] - at, right - 1, right)
    edges = np.flatnonzero(np.abs(at - sync_s[nearest]) <= within_s)
    _, first = np.unique(nearest[edges], return_index=True)
    return edges[first], nearest[edges[first]]


def _line_under(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return offset and slope of the line below all points that is highest at the mean of x.

    The offset is at x = 0. The height at the mean is a concave function of the slope; its
    subgradient is the position of the lowest point.
    """
    centre = float(x.mean())
    around = x - centre
    low, high = -LARGEST_RATE_ERROR, LARGEST_RATE_ERROR
    for _ in range(BISECTIONS):
        slope = (low + high) / 2.0
        if around[int(np.argmin(y - slope * around))] > 0.0:
            high = slope
        else:
            low = slope
    slope = (low + high) / 2.0
    height = float(np.min(y - slope * around))
    return height - slope * centre, slope


def _deal(stretch: IntArray, hands: int) -> list[BoolArray]:
    return [stretch % hands == hand for hand in range(hands)]


def _gain(half: float, eighth: float) -> float:
    """Return the height of the eighths' lines above the whole fit, divided by this fit's error.

    The lowest of N delays exceeds the shortest possible delay by about N^-k. Therefore the ratio is
    8^k - 1. The exponent k is 1 if short delays are as frequent as others, and less if they are
    rare. It follows from `half` and `eighth`: the mean heights of the lines below halves and
    eighths of the reads, relative to the line below all reads. The exponent is limited to 1/2. Then
    the uncertainty may be too large, but not too small.
    """
    ratio = max(eighth / half, 3.0) if half > 0.0 else np.inf  # (8^k - 1) / (2^k - 1)
    growth = min((np.sqrt(4.0 * ratio - 3.0) - 1.0) / 2.0, np.sqrt(2.0))  # 2^k
    return float(max(growth, SLOWEST_GROWTH) ** 3 - 1.0)


def _regular(covariance: FloatArray, x: FloatArray) -> FloatArray:
    """Return a covariance that is not smaller than rounding errors."""
    tiny = 1e-9
    return np.asarray(covariance + np.diag([tiny**2, (tiny / max(float(np.ptp(x)), 1.0)) ** 2]))


def _wander(x: FloatArray, above: FloatArray, expected: float) -> float:
    """Return the RMS height of the earliest arrival in each eighth of the run above the line.

    The part that chance alone would cause is subtracted. It follows from `expected`, the mean
    square height for eighths whose rows are spread over the whole run.
    """
    lowest = [float(part.min()) for part in np.array_split(above[np.argsort(x)], SUBSETS)]
    return float(np.sqrt(max(0.0, float(np.mean(np.square(lowest))) - 4.0 * expected)))


def _wander_of_means(x: FloatArray, rest: FloatArray, variance: float) -> float:
    """Return the RMS of the residuals' means over eighths of the run, minus that of white noise."""
    parts = np.array_split(rest[np.argsort(x)], SUBSETS)
    power = [float(part.mean()) ** 2 - 2.0 * variance / len(part) for part in parts if len(part)]
    return float(np.sqrt(max(0.0, float(np.mean(power)))))
