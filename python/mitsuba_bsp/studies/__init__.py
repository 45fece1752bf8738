"""The studies of the thesis, completed: each a plan of measurements, tables and figures."""

from . import claims, comparison, convergence, cost, directions, hotspots, normals, planes, slice  # noqa: A004
from .study import Study

STUDIES: dict[str, Study] = {
    study.name: study
    for study in (
        directions.STUDY,
        planes.STUDY,
        comparison.STUDY,
        cost.STUDY,
        convergence.STUDY,
        claims.STUDY,
        hotspots.STUDY,
        normals.STUDY,
        slice.STUDY,
    )
}
