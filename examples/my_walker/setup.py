"""Build my_walker with colcon."""

from setuptools import setup

setup(
    name='my_walker',
    version='0.1.0',
    packages=['my_walker'],
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/my_walker']),
        ('share/my_walker', ['package.xml']),
        ('share/my_walker/config', ['config/desk_leg.yaml', 'config/desk_walker.yaml']),
        ('share/my_walker/launch', ['launch/walk.launch.py']),
    ],
    zip_safe=False,
)
