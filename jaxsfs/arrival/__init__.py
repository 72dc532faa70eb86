"""Arrival times of a front of given speed on a plane."""

from jaxsfs.arrival._solve import ArrivalTimes, arrival_from_point, arrival_times

__all__ = ["ArrivalTimes", "arrival_from_point", "arrival_times"]
