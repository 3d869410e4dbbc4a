from .certificate import ForeignCertificate as ForeignCertificate
from .log import ForeignLog as ForeignLog
from .log import read_log as read_log
from .setup import ForeignSetup as ForeignSetup
