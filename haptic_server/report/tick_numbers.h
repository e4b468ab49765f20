// A tick's signals as numbers, for programs in other languages: the columns of tick_columns.h.
#pragma once

#include <string>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// Their names, separated by commas: NAME or, where a number stands for a word, NAME=WORD|WORD...
std::string tick_number_names();
/// How many there are.
std::size_t tick_number_count();
/// Writes as many numbers as there are names. Returns the end of what it wrote.
double* copy_numbers(const TickRecord& record, double* to);

}  // namespace hlm::server
