// The tick log's text form: a header line with names and units, then one line for each tick.
//
// The columns are those of tick_columns.h, separated by commas. Numbers are the shortest text that
// reads back to the same double; flags are 0 or 1, states the words of common/vocabulary.h.
#pragma once

#include <string>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// The header line, with its line end.
std::string tick_csv_header();
/// Appends the line of one tick, with its line end.
void append_tick_csv(const TickRecord& record, std::string& text);

}  // namespace hlm::server
