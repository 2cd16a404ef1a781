"""The columns of a comparison's tables."""

from umbel.bench.table import Column

RATIOS = ("sah_ratio", "epo_ratio", "speed_ratio", "lq_ratio", "hq_ratio")
COLUMNS = [
    Column("scene", "scene"),
    Column("width", "width", "d"),
    Column("builder", "builder"),
    Column("build_seconds", "build s", ".3f"),
    Column("mtriangles_per_second", "M tri/s", ".2f"),
    Column("sah_cost", "SAH", ".1f"),
    Column("epo", "EPO", ".2f"),
    Column("mrays_per_second", "M rays/s", ".2f"),
    Column("lq_seconds", "LQ s", ".2f"),
    Column("hq_seconds", "HQ s", ".2f"),
    Column("sah_ratio", "SAH ratio", ".3f"),
    Column("epo_ratio", "EPO ratio", ".2f"),
    Column("speed_ratio", "speed ratio", ".3f"),
    Column("lq_ratio", "LQ ratio", ".3f"),
    Column("hq_ratio", "HQ ratio", ".3f"),
]
MEANS = [
    Column("width", "width", "d"),
    Column("builder", "builder"),
    Column("mtriangles_per_second", "M tri/s", ".2f"),
    *[column for column in COLUMNS if column.field in RATIOS],
]
CHEAPEST = [
    Column("scene", "scene"),
    Column("width", "width", "d"),
    Column("builder", "builder"),
    Column("from_samples", "from samples a pixel", ".3g"),
    Column("from_mrays", "from M rays", ".3g"),
]
