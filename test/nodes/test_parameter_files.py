"""Parameters as `ros2 param dump` and `ros2 param load` exchange them with a running node."""

from pathlib import Path

from playable_logs import write_bag
import pytest
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import parameter_dict_from_yaml_file, parameter_value_to_python
from ros_domain import Domain
import yaml

CONFIG = Path(__file__).resolve().parents[2] / 'config'
LEGS = ('--params-file', str(CONFIG / 'walker6_two_motors.yaml'))
NODES = {
    'solver_node': LEGS,
    'crank_node': ('-p', 'speed:=1e-3'),
    'recorder_node': ('-p', 'output:=run'),
    'player_node': (),
    'sim_node': LEGS,
    'view_node': ('-p', 'port:=0'),
    'walker_node': LEGS,
    'watchdog_node': ('-p', 'joints:=[left_crank]'),
}


def dump(ros: Domain, node: str, file: Path) -> None:
    """Write a node's parameters as `ros2 param dump` does."""
    listed = ros.probe.call(ListParameters, f'{node}/list_parameters', ListParameters.Request())
    names = sorted(listed.result.names)
    request = GetParameters.Request(names=names)
    values = ros.probe.call(GetParameters, f'{node}/get_parameters', request).values
    content: dict[str, object] = {}
    for name, value in zip(names, values, strict=True):
        *folders, last = name.split('.')
        branch = content
        for folder in folders:
            branch = branch.setdefault(folder, {})  # type: ignore[assignment]
        branch[last] = parameter_value_to_python(value)
    file.write_text(yaml.dump({f'/{node}': {'ros__parameters': content}}))


def load(ros: Domain, node: str, file: Path) -> list[str]:
    """Set a node's parameters as `ros2 param load` does; return why any of them is refused."""
    parameters = parameter_dict_from_yaml_file(str(file), target_nodes=[f'/{node}'])
    request = SetParameters.Request(parameters=list(parameters.values()))
    results = ros.probe.call(SetParameters, f'{node}/set_parameters', request).results
    pairs = zip(parameters, results, strict=True)
    return [f'{name}: {result.reason}' for name, result in pairs if not result.successful]


@pytest.mark.parametrize('node', NODES)
def test_a_node_takes_its_own_dump(ros: Domain, tmp_path: Path, node: str) -> None:
    log = [str(write_bag(tmp_path / 'bag')), '--start-paused'] if node == 'player_node' else []
    process = ros.start(node, *log, '--ros-args', *NODES[node])
    dump(ros, node, tmp_path / 'dump.yaml')
    assert load(ros, node, tmp_path / 'dump.yaml') == []
    assert process.stop() == 0
