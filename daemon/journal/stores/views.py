"""The read-only views of the journal for other programs, `constants` and `constants_all`: see docs/production.md.

They are made again at each start of a daemon and hold no data. The events' headers, which are JSON, hold the constants.
"""

import hashlib
from string import Template

COLUMNS = (
    *("sample", "step", "constant", "re", "im", "u_re", "u_im", "unit", "free", "derived"),
    *("fitter", "version", "chi2_per_dof", "converged", "measurement", "measured", "state", "station"),
    *("operator", "temperature_C", "mass_g", "batch", "barcode", "metadata"),
)
"""The columns of both views."""

_ALL = Template("""
SELECT m.sample AS sample, m.step AS step, c.key AS constant,
    $re AS re, $im AS im, $u_re AS u_re, $u_im AS u_im, $unit AS unit, $free AS free, c.derived AS derived,
    f.fitter AS fitter, f.version AS version, $chi2 AS chi2_per_dof, $converged AS converged,
    m.id AS measurement, m.time AS measured, m.state AS state, m.station AS station,
    $operator AS operator, $temperature AS "temperature_C", $mass AS mass_g, $batch AS batch, $barcode AS barcode,
    $metadata AS metadata, m.number AS number
FROM measurements m
JOIN fits f ON f.measurement = m.id AND f.kind = 'fit' AND f.ok = 1
    AND f.seq = (SELECT max(n.seq) FROM fits n WHERE n.measurement = f.measurement AND n.fitter = f.fitter
        AND n.kind = 'fit' AND n.ok = 1)
JOIN events e ON e.station = f.station AND e.seq = f.seq
JOIN builds b ON b.hash = m.build
$each
WHERE m.state IN ('measured', 'withdrawn')
""")
_NAMES = ", ".join('"temperature_C"' if name == "temperature_C" else name for name in (*COLUMNS, "number"))
_LATEST = f"""
SELECT {_NAMES} FROM (SELECT *, max(number) OVER (PARTITION BY sample, step, fitter) AS newest FROM constants_all
    WHERE state = 'measured') AS measured_constants
WHERE number = newest
"""  # noqa: S608


def _sqlite() -> str:
    report, meta = (
        "json_extract(CAST(e.header AS TEXT), '$.report.{}')",
        "json_extract(CAST(b.json AS TEXT), '$.metadata{}')",
    )
    each = "JOIN json_each(CAST(e.header AS TEXT), '$.report.{}') c"
    halves = [
        _ALL.substitute(
            re="json_extract(c.value, '$.re')",
            im="json_extract(c.value, '$.im')",
            u_re="json_extract(c.value, '$.u_re')",
            u_im="json_extract(c.value, '$.u_im')",
            unit="json_extract(c.value, '$.unit')",
            free="json_extract(c.value, '$.free')",
            chi2=report.format("chi2_per_dof"),
            converged=report.format("converged"),
            operator=meta.format(".operator"),
            temperature=meta.format(".temperature_C"),
            mass=(
                "(SELECT 1000 * json_extract(t.value, '$.mass.re') FROM json_each(CAST(b.json AS TEXT), '$.steps') t "
                "WHERE json_extract(t.value, '$.name') = m.step)"
            ),
            batch=meta.format(".batch"),
            barcode=meta.format(".barcode"),
            metadata=meta.format(""),
            each=each.format(table),
        ).replace("c.derived", str(derived))
        for table, derived in (("constants", 0), ("derived", 1))
    ]
    return " UNION ALL ".join(halves)


def _postgres() -> str:
    report, meta = (
        "(convert_from(e.header, 'UTF8')::json -> 'report'",
        "(convert_from(b.json, 'UTF8')::json -> 'metadata'",
    )
    each = (
        f"CROSS JOIN LATERAL (SELECT key, value, 0 AS derived FROM json_each({report} -> 'constants')) "  # noqa: S608
        f"UNION ALL SELECT key, value, 1 FROM json_each({report} -> 'derived'))) c"
    )
    return _ALL.substitute(
        re="(c.value ->> 're')::float8",
        im="(c.value ->> 'im')::float8",
        u_re="(c.value ->> 'u_re')::float8",
        u_im="(c.value ->> 'u_im')::float8",
        unit="c.value ->> 'unit'",
        free="(c.value ->> 'free')::boolean::int",
        chi2=f"({report} ->> 'chi2_per_dof'))::float8",
        converged=f"({report} ->> 'converged'))::boolean::int",
        operator=f"{meta} ->> 'operator')",
        temperature=f"({meta} ->> 'temperature_C'))::float8",
        mass=(
            "(SELECT 1000 * (t -> 'mass' ->> 're')::float8 FROM json_array_elements("
            "convert_from(b.json, 'UTF8')::json -> 'steps') t WHERE t ->> 'name' = m.step)"
        ),
        batch=f"{meta} ->> 'batch')",
        barcode=f"{meta} ->> 'barcode')",
        metadata=f"{meta})::text",
        each=each,
    )


DROP = "DROP VIEW IF EXISTS constants; DROP VIEW IF EXISTS constants_all;"
SQLITE_VIEWS = (f"CREATE VIEW constants_all AS {_sqlite()}", f"CREATE VIEW constants AS {_LATEST}")
POSTGRES_VIEWS = f"{DROP} CREATE VIEW constants_all AS {_postgres()}; CREATE VIEW constants AS {_LATEST};"
POSTGRES_MARK = hashlib.sha256(POSTGRES_VIEWS.encode()).hexdigest()[:16]
"""Comment on the view in PostgreSQL, which tells a daemon whether the views are those of its version."""


def constants_query(*, latest: bool, postgres: bool) -> str:
    """Return the statement behind a view, for a journal that no daemon of this version has opened yet."""
    everything = _postgres() if postgres else _sqlite()
    rows = _LATEST if latest else f"SELECT {_NAMES} FROM constants_all"  # noqa: S608
    return f"WITH constants_all AS ({everything}) SELECT * FROM ({rows}) AS found ORDER BY number, constant"  # noqa: S608
