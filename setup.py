"""Build klann_ros with colcon (ament_python) and with pip: one source tree for both."""

from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NAME = 'klann_ros'
# `colcon build --symlink-install` runs a link to this file, in a folder without the README.
HERE = Path(__file__).resolve().parent

# ROS itself is no requirement of the distribution: where ROS 2 is sourced, rclpy is there already
# without a distribution of that name. package.xml names it for rosdep, the extra "ros" (Jazzy) or
# "ros-kilted" for pip. Its wheels are for one system; elsewhere the other programs are installed.
WITH_ROS = '; sys_platform == "linux" and platform_machine == "x86_64"'
JAZZY = [f'ros-jazzy-rclpy[fastrtps]{WITH_ROS}', f'ros-jazzy-common-interfaces{WITH_ROS}']
KILTED = [f'ros-kilted-rclpy[fastrtps]{WITH_ROS}', f'ros-kilted-common-interfaces{WITH_ROS}']
EXTRAS = {
    'pandas': ['pandas'],
    'plot': ['matplotlib'],
    'fast': ['numba'],
    'dynamics': ['scipy'],
    'calibration': ['scipy'],
    'design': ['fonttools', 'pymoo', 'scipy'],
    'cluster': ['ray'],
    'view': ['aiohttp>=3.9.1'],
    'dxf': ['ezdxf'],
    'parquet': ['pyarrow'],
    'parts': ['lxml', 'manifold3d', 'networkx', 'trimesh'],
    'sim': ['mujoco'],
}
# Who has a cluster knows it; nobody else wants 80 MB of Ray.
WITHOUT_ROS = {name for extra in EXTRAS if extra != 'cluster' for name in EXTRAS[extra]}
EXTRAS['ros'] = JAZZY
EXTRAS['ros-kilted'] = KILTED
EXTRAS['all'] = sorted({*WITHOUT_ROS, *JAZZY})
EXTRAS['all-kilted'] = sorted({*WITHOUT_ROS, *KILTED})
EXTRAS['test'] = [
    'aiohttp',
    'axe-playwright-python',
    'ezdxf',
    'fonttools',
    'hypothesis',
    'junitparser',
    'lxml',
    'manifold3d',
    'mcap-ros2-support',
    'mujoco',
    'networkx',
    'pandas',
    'playwright',
    'pymoo',
    'pyserial',
    'pytest>=7.4',
    'pytest-xdist',
    'rosbags',
    'scipy',
    'shapely',
    'trimesh',
    'xacro',
    'yourdfpy',
]

setup(
    name=NAME,
    version='0.1.0',
    description='Crank-driven leg linkages: kinematics, simulation, ROS 2 nodes, logs, review',
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    maintainer='klann_ros maintainers',
    maintainer_email='maintainers@users.noreply.h-seed-5572db61.example',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: ['py.typed', 'linkages/*.yaml'],
        f'{NAME}.kinematics.linkage': ['schema.json'],
        f'{NAME}.export': ['materials.yaml', 'static/*'],
        f'{NAME}.exercises': ['exercises.yaml', 'static/*'],
        f'{NAME}.live': ['static/*'],
        f'{NAME}.sanitize': ['units.yaml'],
        f'{NAME}.datasheet': ['static/*'],
        f'{NAME}.design': ['schema.json', 'static/*'],
        f'{NAME}.web': ['static/*', 'static/js_yaml/*', 'static/three/*', 'static/uplot/*'],
        f'{NAME}.web.lab': ['lab.html', 'static/*', 'static/practice/*'],
        f'{NAME}.review.page': ['static/*'],
    },
    python_requires='>=3.10',
    install_requires=[
        'argcomplete',
        'jsonschema',
        'lz4',
        'mcap>=1.6.0',
        'numpy',
        'PyYAML',
        'tqdm',
        'zstandard',
    ],
    extras_require=EXTRAS,
    zip_safe=False,
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml', f'{NAME}/web/lab/lab.html']),
        (f'share/{NAME}/config', glob('config/*.yaml')),
        (f'share/{NAME}/linkages', glob(f'{NAME}/linkages/*.yaml')),
        (f'share/{NAME}/launch', glob('launch/*.py')),
        (f'share/{NAME}/requirements', glob('examples/requirements/*.*')),
        (f'share/{NAME}/requirements/motors', glob('examples/requirements/motors/*.yaml')),
        (f'share/{NAME}/urdf', [*glob('urdf/*.xacro'), *glob('urdf/*.urdf')]),
        (f'share/{NAME}/rviz', glob('rviz/*.rviz')),
        (f'share/{NAME}/foxglove', glob('foxglove/*.json')),
        (f'share/{NAME}/plotjuggler', glob('plotjuggler/*.xml')),
        # `ros2 run` looks in lib/klann_ros; pip puts its scripts in bin only. colcon overwrites
        # these launchers with executables of its own.
        (f'lib/{NAME}', glob('scripts/launchers/*')),
    ],
    entry_points={
        'console_scripts': [
            f'{name} = klann_ros.executables:{name}'
            for name in (
                'solver_node',
                'crank_node',
                'drive',
                'walker_node',
                'recorder_node',
                'player_node',
                'view_node',
                'sim_node',
                'watchdog_node',
                'commission_node',
                'review',
                'recover',
                'export',
                'describe',
                'calibrate',
                'exercise',
                'design',
                'import_linkage',
            )
        ],
    },
)
