"""Scripted experts, by the name of their task."""

from fetch_composer.policies.experts.pick_and_place import PickAndPlaceExpert
from fetch_composer.policies.experts.push import PushExpert
from fetch_composer.policies.experts.reach import ReachExpert
from fetch_composer.policies.experts.slide import SlideExpert
from fetch_composer.policies.protocol import Policy

EXPERTS: dict[str, type[Policy]] = {
    'pick_and_place': PickAndPlaceExpert,
    'push': PushExpert,
    'reach': ReachExpert,
    'slide': SlideExpert,
}
