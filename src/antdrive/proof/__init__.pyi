from .track import Proof as Proof
from .track import Track as Track
from .track import prove as prove
