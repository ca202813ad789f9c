"""Every rule of the contract as a test, for the consumer that the fixture wrcd_consumer gives.

    pytest --pyargs wrcd.contract.checks --wrcd-object my_receiver.py:Receiver

or in a test module of one's own, beside a fixture wrcd_consumer: from wrcd.contract.checks import test_contract
"""

from collections.abc import Callable

from wrcd.contract.contract_rules import Check


def test_contract(wrcd_check: Check, wrcd_judge: Callable[[Check], None]) -> None:
    """Play one rule, and fail with the sentence that says how it was broken."""
    wrcd_judge(wrcd_check)
