import pytest
from ros_session import RosSession


@pytest.fixture
def ros(tmp_path):
    """A ROS master of the test's own; all that it started ends with the test."""
    try:
        session = RosSession(tmp_path)
    except RuntimeError as error:
        pytest.skip(str(error))
    yield session
    session.stop()
