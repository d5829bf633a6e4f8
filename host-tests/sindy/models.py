"""SINDy's models of a set of records: as its documentation starts, with delays, and with the catalog's laws as terms."""

from dataclasses import dataclass

import numpy as np
import pysindy as ps

from records import Array, Lag, Record, gap
from terms import STATE_LAWS, Commands, Term, catalog, mean_over_rows

# Chosen: what a further term has to take off the RMS of the simulation, 0.5 %; then it changes the prediction by a tenth of what is left,
# from which on the diagnosis names an effect.
LEAST_GAIN = 0.005
# Chosen: enough for a few dozen coefficients of six to twelve records; twice as many change no name of those tried.
DOMAINS = 200
LAGGING = ("second_pole", "moving_average", "transport_delay")
# Of the places of test functions.
SEED = 1


@dataclass(frozen=True)
class Fit:
    """What a model says: the effects of its terms in their order, and the response by row."""

    names: list[tuple[str, ...]]
    values: dict[str, float]
    equation: str
    simulated: list[Array]


def fitted(record: Record) -> np.ndarray:
    return ~record.held_out


class LagFirst(ps.FROLS):
    """Pysindy's forward regression, where the terms of the lag are in the model before any other."""

    def __init__(self, lag_terms: int, further: int) -> None:
        super().__init__(max_iter=lag_terms + further, alpha=1e-10, normalize_columns=True, unbias=False)
        self.lag_terms = lag_terms
        self.further = further

    def _select_function(self, x, y, sigma, skip=()):  # noqa: ANN001, ANN202
        # Column 0 is the state itself, which the terms of the lag hold by point.
        if len(skip) < self.lag_terms:
            chosen = len(skip) + 1
            return chosen, 0.0, self._normed_cov(x[:, chosen], y)
        return super()._select_function(x, y, sigma, [0, *skip])


@dataclass(frozen=True)
class Blocks:
    """A record as means over blocks of rows, as deviations of the command, with the response at their ends."""

    record: Record
    lag: Lag
    rows: int
    offset: float

    def mean(self, by_row: Array) -> Array:
        whole = len(by_row) // self.rows * self.rows
        return by_row[:whole].reshape(-1, self.rows).mean(axis=1)

    def command(self) -> Array:
        return self.record.command - self.record.nominal

    def response(self) -> Array:
        return (self.record.response - self.offset) / self.lag.gain

    def by_row(self, at_ends: Array) -> Array:
        count = len(self.record.command)
        return self.offset + self.lag.gain * np.interp(np.arange(count) / self.rows, np.arange(len(at_ends)), at_ends)


def blocks(record: Record, lag: Lag, rows: int) -> Blocks:
    before = slice(0, record.fitted_rows() or len(record.command))
    offset = float(record.response[before].mean() - lag.gain * (record.command[before] - record.nominal).mean())
    return Blocks(record, lag, rows, offset)


def with_catalog(records: list[Record], lags: dict[float, Lag], further: int = 4) -> Fit:
    """Weak SINDy over the lag of each point and the laws of the catalog."""
    np.random.seed(SEED)
    tau_s = float(np.median([lag.time_constant_s for lag in lags.values()]))
    # Chosen: 20 blocks in a time constant, and test functions of one, which let pass what is faster than the lag.
    rows = max(1, int(tau_s / 20 / records[0].step_s))
    half_width_s = max(0.5 * tau_s, 4 * rows * records[0].step_s)
    cut = [blocks(record, lags[record.nominal], rows) for record in records]
    step_s = rows * records[0].step_s
    points = sorted(lags)
    trained = [k for k, record in enumerate(records) if record.is_fitted]
    length = min(records[k].fitted_rows() // rows for k in trained)
    rows_in_all = max(len(record.command) for record in records)
    deviation = np.stack([np.pad(block.command(), (0, rows_in_all - len(block.command())), mode="edge") for block in cut], axis=1)
    nominal = np.array([record.nominal for record in records])
    terms, columns = [], []
    for term, by_row in catalog(Commands(deviation, nominal, records[0].step_s), tau_s):
        means = [block.mean(one[: len(block.record.command)]) for block, one in zip(cut, by_row.T, strict=True)]
        # A law that nothing shows has no column.
        if any(means[k][:length].any() for k in trained):
            terms.append(term)
            columns.append(means)
    inputs, states, fit_inputs = [], [], []
    for k, block in enumerate(cut):
        speed = 1.0 / block.lag.time_constant_s
        response = block.response()
        z, v = block.mean(mean_over_rows(response)), block.mean(block.command())
        is_point = [float(point == block.record.nominal) for point in points]
        lag_terms = [one * column for one in is_point for column in (z, v)]
        start = [np.full(len(v), float(k == other)) for other in trained]
        laws = [law(z, v, nominal[k]) for law in STATE_LAWS.values()]
        inputs.append(speed * np.column_stack([column[k] for column in columns]))
        states.append((z, v))
        fit_inputs.append(np.column_stack([speed * np.column_stack([*lag_terms, *start, *laws]), inputs[k]]))
    time_s = np.arange(length) * step_s
    library = ps.WeakPDELibrary(
        function_library=ps.IdentityLibrary(),
        spatiotemporal_grid=time_s,
        K=min(DOMAINS, 1 + int(time_s[-1] / half_width_s)),
        H_xt=half_width_s,
    )
    lag_count = 2 * len(points) + len(trained)
    optimizer = LagFirst(lag_count, further)
    ps.SINDy(feature_library=library, optimizer=optimizer).fit(
        [states[k][0][:length, None] for k in trained], t=time_s, u=[fit_inputs[k][:length] for k in trained]
    )
    path = np.array([step[0, 1:] for step in optimizer.history_])[lag_count:]
    drives = []
    for k, block in enumerate(cut):
        place = points.index(block.record.nominal)
        start = path[:, 2 * len(points) + trained.index(k)] if k in trained else 0.0 * path[:, 0]
        speed = 1.0 / block.lag.time_constant_s
        drive = speed * (np.outer(states[k][1], path[:, 2 * place + 1]) + start) + inputs[k] @ path[:, lag_count + len(STATE_LAWS) :].T
        drives.append(Drive(speed * path[:, 2 * place], drive, speed, states[k][1], block.record.nominal))
    laws = path[:, lag_count : lag_count + len(STATE_LAWS)]
    starts = np.array([states[k][0][0] for k in range(len(cut))])
    simulated = integrate(drives, laws, starts, step_s)
    return _choose(path, lag_count, terms, cut, simulated)


@dataclass(frozen=True)
class Drive:
    """What drives one record in each model of a path: `z' = rate z + input + speed * laws(z)`."""

    rate: Array
    input: Array
    speed: float
    command: Array
    nominal: float


def integrate(drives: list[Drive], laws: Array, starts: Array, step_s: float) -> Array:
    """Heun's method, all records and models at once; gives records by models by times."""
    rate = np.stack([drive.rate for drive in drives])
    count = max(len(drive.input) for drive in drives)
    inputs = np.stack([np.pad(drive.input, ((0, count - len(drive.input)), (0, 0)), mode="edge") for drive in drives], axis=1)
    command = np.stack([np.pad(drive.command, (0, count - len(drive.command)), mode="edge") for drive in drives], axis=1)
    speed = np.array([[drive.speed] for drive in drives])
    nominal = np.array([[drive.nominal] for drive in drives])
    active = [(law, speed * laws[:, j]) for j, law in enumerate(STATE_LAWS.values()) if laws[:, j].any()]
    z = np.repeat(starts[:, None], len(laws), axis=1)
    out = np.empty((count + 1, *z.shape))
    out[0] = z
    for k in range(count):
        v = command[k][:, None]

        def slope(z: Array, k: int = k, v: Array = v) -> Array:
            total = rate * z + inputs[k]
            for law, factor in active:
                total = total + factor * law(z, v, nominal)
            return total

        first = slope(z)
        z = np.clip(z + 0.5 * step_s * (first + slope(z + step_s * first)), -1e3, 1e3)
        out[k + 1] = z
    return out.transpose(1, 2, 0)


def _choose(path: Array, lag_count: int, terms: list[Term], cut: list[Blocks], simulated: Array) -> Fit:
    """The model of most terms of which each takes enough off the simulation of the rows that are fitted."""
    records = [block.record for block in cut]
    by_row = [[block.by_row(one) for block, one in zip(cut, simulated[:, m], strict=True)] for m in range(len(path))]
    gaps = [gap(records, rows, fitted) for rows in by_row]
    best = 0
    for further in range(1, len(path)):
        if gaps[further] < (1.0 - LEAST_GAIN) ** (further - best) * gaps[best]:
            best = further
    kinds = [*STATE_LAWS, *(term.kind for term in terms)]
    names, values, known = [], {}, set(np.flatnonzero(path[0]))
    for model in path[1 : best + 1]:
        (new,) = set(np.flatnonzero(model)) - known
        known.add(new)
        coefficient = float(path[best][new])
        # What is ahead of the command where a lag is behind it is a lead.
        kind = kinds[new - lag_count]
        kind = "inflow_lead" if kind in LAGGING and coefficient < 0 else kind
        names.append((kind,))
        place = new - lag_count - len(STATE_LAWS)
        # The term of a drift is a straight line in time, and has no number of the catalog's.
        if kind != "gain_drift":
            values.setdefault(kind, _value(kind, coefficient, terms[place] if place >= 0 else None))
    return Fit(names, values, f"{best} terms, gaps of the fitted rows {np.round(gaps, 2)} %", by_row[best])


def _value(kind: str, coefficient: float, term: Term | None) -> float:
    """What a term says of its effect's parameter."""
    if kind == "asymmetric_lag":
        return 1.0 + coefficient
    if term is None or term.reading == "coefficient":
        return coefficient
    return term.value * coefficient if term.reading == "scaled" and kind != "inflow_lead" else term.value
