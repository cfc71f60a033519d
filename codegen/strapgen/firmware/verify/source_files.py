"""Generated files as back ends: what `compare --source` takes."""

from strapgen.firmware.verify.verification import file_backend as file_backend
from strapgen.firmware.verify.verify_command import header_command_of as header_command_of
