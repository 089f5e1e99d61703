"""Scripted experts, by the name of their task."""

from fetch_composer.policies.experts.pick_and_place import PickAndPlaceExpert
from fetch_composer.policies.experts.push import PushExpert
from fetch_composer.policies.experts.push_around import PushAroundExpert
from fetch_composer.policies.experts.push_two import PushTwoExpert
from fetch_composer.policies.experts.reach import ReachExpert
from fetch_composer.policies.experts.slide import SlideExpert
from fetch_composer.policies.experts.stack import StackExpert
from fetch_composer.policies.protocol import Policy

EXPERTS: dict[str, type[Policy]] = {
    'pick_and_place': PickAndPlaceExpert,
    'push': PushExpert,
    'push_around': PushAroundExpert,
    'push_two': PushTwoExpert,
    'reach': ReachExpert,
    'slide': SlideExpert,
    'stack': StackExpert,
}
