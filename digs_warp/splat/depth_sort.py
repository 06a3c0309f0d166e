"""Sort the splats of a view by depth, on one CPU core: a radix sort, from the last digit on.

Only what the depths of the view differ in is sorted: as whole numbers, the bits of two floats a factor of two
apart differ by less than 2^24, which are two digits. Splats that are not drawn are left out. Equal depths
keep the order of their index.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

_DIGIT_BITS = wp.constant(12)
_ROUND_BITS = wp.constant(24)
_VALUES = wp.constant(1 << 12)
# Two digits are counted at once.
HISTOGRAM = 2 << 12

_HISTOGRAM = wp.constant(HISTOGRAM)
_LARGEST = wp.constant(0x7FFFFFFF)


@wp.func
def first_digit(key: int) -> int:
    """Place of the lower digit in the histogram."""
    return key & (_VALUES - 1)


@wp.func
def second_digit(key: int) -> int:
    """Place of the next digit in the histogram, behind all of the lower one."""
    return _VALUES + ((key >> _DIGIT_BITS) & (_VALUES - 1))


@wp.func
def slot_of(place: int, histogram: wp.array[int]) -> int:
    """Where the next key of a digit goes."""
    slot = histogram[place]
    histogram[place] = slot + 1
    return slot


@wp.kernel
def depth_sort_kernel(
    first: int,
    count: int,
    depths: wp.array[float],  # [n], above 0 where the splat is drawn
    row_counts: wp.array[int],  # [n] tile rows that the splat touches, 0 if it is not drawn
    histogram: wp.array[int],  # [HISTOGRAM]
    spare: wp.array[wp.vec2i],  # [n]
    # outputs
    order: wp.array[wp.vec2i],  # [n] sorting key and number of the drawn splats, nearest first
    sorted_count: wp.array[int],  # [1] how many they are
):
    """Sort in one thread; ``first`` is that of every launch on all cores, and 0."""
    nearest = int(_LARGEST)
    farthest = int(0)
    size = int(0)
    for g in range(count):
        if row_counts[g] > 0:
            # The bits of a positive float order like the float itself.
            bits = wp.cast(depths[g], wp.int32)
            nearest = wp.min(nearest, bits)
            farthest = wp.max(farthest, bits)
            order[size] = wp.vec2i(bits, g)
            size += 1
    sorted_count[0] = size

    shift = int(0)
    while shift <= _ROUND_BITS and (shift == 0 or farthest - nearest >= (1 << _ROUND_BITS)):
        for place in range(_HISTOGRAM):
            histogram[place] = 0
        for i in range(size):
            key = (order[i][0] - nearest) >> shift
            histogram[first_digit(key)] = histogram[first_digit(key)] + 1
            histogram[second_digit(key)] = histogram[second_digit(key)] + 1
        first_total = int(0)
        second_total = int(0)
        for value in range(_VALUES):
            first_found = histogram[value]
            histogram[value] = first_total
            first_total += first_found
            second_found = histogram[_VALUES + value]
            histogram[_VALUES + value] = second_total
            second_total += second_found
        for i in range(size):
            entry = order[i]
            spare[slot_of(first_digit((entry[0] - nearest) >> shift), histogram)] = entry
        for i in range(size):
            entry = spare[i]
            order[slot_of(second_digit((entry[0] - nearest) >> shift), histogram)] = entry
        shift += _ROUND_BITS
