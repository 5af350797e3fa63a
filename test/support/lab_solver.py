"""The lab's solver in node: its scripts with a driver behind them, JSON in, JSON out."""

from collections.abc import Iterable, Mapping
import json
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any

from klann_ros.kinematics.linkage.file import SHIPPED, shipped_linkages
from klann_ros.web.lab.build import SOLVER
from klann_ros.web.parts import text
import numpy as np
from numpy.typing import NDArray

NODE = shutil.which('node')
TEXTS = {name: text(Path(str(SHIPPED / f'{name}.yaml'))) for name in shipped_linkages()}


def in_node(script: str, given: Any, files: Iterable[Path] = SOLVER) -> Any:
    """Return what a script behind others makes of `given`: what its `answer` returns."""
    driver = (
        "\nimport { readFileSync } from 'node:fs';\n"
        f"const given = JSON.parse(readFileSync(0, 'utf8'));\n{script}\n"
        'process.stdout.write(JSON.stringify(answer(given)));\n'
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'solver.mjs')
        path.write_text('\n'.join(map(text, files)) + driver, encoding='utf-8')
        done = subprocess.run(
            [str(NODE), str(path)],
            input=json.dumps(given),
            capture_output=True,
            encoding='utf-8',
            check=False,
        )
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])
    return json.loads(done.stdout)


POSES = """
function posesOf(base, { numbers, alphas }) {
  let linkage = null;
  try {
    linkage = base.with(numbers);
    if (!linkage.isDyadic) void linkage.branch;
  } catch (error) {
    if (error instanceof Refusal) return { refused: error.message };
    throw error;
  }
  return alphas.map((alpha) => {
    const { points, error, u } = poseAt(linkage, alpha);
    if (error) return { block: error.block, isFar: error.isFar, shortfall: error.shortfall };
    return { points, sine: Math.min(...linkage.blocks.map((block) => Math.abs(block.sine(u)))) };
  });
}

function answer(given) {
  const found = {};
  for (const [name, { text, cases }] of Object.entries(given)) {
    const { linkage } = readFile(text, given.klann ? given.klann.text : text);
    found[name] = cases.map((one) => posesOf(linkage, one));
  }
  return found;
}
"""


def poses_in_node(cases: Mapping[str, list[dict[str, Any]]]) -> dict[str, list[Any]]:
    """Return the poses of shipped linkages with other numbers, at some angles."""
    given = {name: {'text': TEXTS[name], 'cases': one} for name, one in cases.items()}
    answer: dict[str, list[Any]] = in_node(POSES, given)
    return answer


def varied_numbers(
    numbers: tuple[float, ...], rng: np.random.Generator, count: int, share: float
) -> NDArray[np.float64]:
    """Return numbers, each larger or smaller by up to a share, or of 0 by a share of the size."""
    base = np.array(numbers)
    size = np.where(base == 0.0, np.abs(base).max() / 10.0, base)
    return base + share * size * rng.uniform(-1.0, 1.0, (count, len(base)))
