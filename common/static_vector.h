// A vector of bounded size that never allocates. Overflow is a bug of ours and aborts in the
// real-time region (noexcept).
#pragma once

#include <algorithm>
#include <cstddef>

#include <boost/container/static_vector.hpp>

namespace hlm {

template <class T, std::size_t capacity>
using StaticVector = boost::container::static_vector<T, capacity>;

/// Removes the elements for which `gone` holds, keeping the order of the others.
template <class T, std::size_t capacity, class Predicate>
void erase_if(StaticVector<T, capacity>& vector, Predicate gone) {
  vector.erase(std::remove_if(vector.begin(), vector.end(), gone), vector.end());
}

}  // namespace hlm
