"""The columns of a comparison's tables."""

from umbel.bench.table import Column, columns

BASELINE = "sweep"
RATIOS = ("sah_ratio", "epo_ratio", "speed_ratio", "lq_ratio", "hq_ratio")
COLUMNS = columns(
    """
    scene                 | scene
    width                 | width       | d
    builder               | builder
    build_seconds         | build s     | .3f
    mtriangles_per_second | M tri/s     | .2f
    sah_cost              | SAH         | .1f
    epo                   | EPO         | .2f
    mrays_per_second      | M rays/s    | .2f
    lq_seconds            | LQ s        | .2f
    hq_seconds            | HQ s        | .2f
    sah_ratio             | SAH ratio   | .3f
    epo_ratio             | EPO ratio   | .2f
    speed_ratio           | speed ratio | .3f
    lq_ratio              | LQ ratio    | .3f
    hq_ratio              | HQ ratio    | .3f
    """
)
MEANS = [
    Column("width", "width", "d"),
    Column("builder", "builder"),
    Column("mtriangles_per_second", "M tri/s", ".2f"),
    *[column for column in COLUMNS if column.field in RATIOS],
]
CHEAPEST = columns(
    """
    scene        | scene
    width        | width                | d
    builder      | builder
    from_samples | from samples a pixel | .3g
    from_mrays   | from M rays          | .3g
    """
)
