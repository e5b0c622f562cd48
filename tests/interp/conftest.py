"""One thread for each process of tests: two of torch's that wait for one another take ten times as long."""

import pytest
import torch


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)
    torch.manual_seed(0)
