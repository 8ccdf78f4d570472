#pragma once

namespace trochoid::tools {

/// From now on SIGINT, SIGTERM and SIGHUP remove the files that are being written before they end
/// the program as they would have (a shell sees 130, 143, 129). Programs started by this one are
/// not touched. A limit on the size of files, or a reader that has gone (SIGPIPE), makes writing
/// fail instead of ending the program. Call once, from main.
void clean_up_when_interrupted();

/// Ends the program by a signal, whatever was to be done about it before.
[[noreturn]] void end_by(int number);

}  // namespace trochoid::tools
