# SPDX-License-Identifier: MIT
"""A service that is called where it was found last, so that it works on when the master is gone.

rospy asks the master before each call: with a master that is dead authority could not even be given
back. The address is forgotten when nobody answers there.
"""

from http.client import HTTPException
from typing import Any
from xmlrpc.client import Error as XmlRpcError

import rosgraph
import rospy

_NO_MASTER = (OSError, HTTPException, XmlRpcError, rosgraph.MasterException)


class KnownService(rospy.ServiceProxy):
    """Asks the master only for a service that is not known yet, or no longer where it was."""

    def find(self) -> bool:
        """Return whether the service is known, now or since before; waits for no service."""
        if self.uri is None:
            try:
                self.uri = rosgraph.Master(rospy.get_name()).lookupService(self.resolved_name)
            except _NO_MASTER:
                return False
        return True

    def call_within(self, wait: float, *arguments: Any) -> Any:
        """Return the answer; ``wait`` [s] for a service that has to appear first.

        Raises:
            rospy.ROSException: it did not appear.
            rospy.ServiceException: it does not answer.
        """
        if self.find():
            known = self.uri
            try:
                return self(*arguments)
            except rospy.ServiceException as error:
                if "unable to connect" not in str(error):
                    raise  # it may have begun to act
                if self.uri == known:
                    self.uri = None
        rospy.wait_for_service(self.resolved_name, wait)
        return self(*arguments)

    def _get_service_uri(self, request: Any) -> str:
        """Return the address: rospy's own, which always asks, only where none is known."""
        return self.uri or super()._get_service_uri(request)
