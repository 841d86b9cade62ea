"""The Unitree H1 with active neck and Inspire hands, as the paper's operators drove it."""

from robots.catalog import Robot
from robots.h1.meshes import missing
from robots.h1.model import build
from robots.h1.spec import H1

ROBOT = Robot(spec=H1, build=build, missing=missing)
