// Records from one task to another without a lock: one writer, one reader.
//
// Only the writer stores `head_`, only the reader `tail_`; each is published with release and read by the other with
// acquire, so what lies between them is whole. A record is never split over the ring's seam: the reader gets it where
// it lies. A ring that is at least twice as large as its largest record takes that record whenever it is empty.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace gemelo {

struct Record {
    uint64_t time_us;
    uint32_t size;
    uint8_t kind;  // as the two tasks agree
    uint8_t flags;
    const uint8_t* bytes;  // valid until pop()
};

template <uint32_t kCapacity>
class Ring {
  public:
    // False if it does not fit now; nothing is kept then.
    bool push(uint8_t kind, uint8_t flags, uint64_t time_us, const void* bytes, size_t size) {
        uint8_t* room = reserve(size);
        if (room == nullptr) return false;
        if (bytes != nullptr && size != 0) memcpy(room, bytes, size);
        commit(kind, flags, time_us, size);
        return true;
    }

    // Where the writer may put `size` bytes piece by piece until commit(); nullptr if they do not fit now. The reader
    // sees nothing of them before that, and whatever is pushed or reserved meanwhile takes the same place.
    uint8_t* reserve(size_t size) {
        if (size > kCapacity / 2 - kGrain) return nullptr;
        const uint32_t need = space_for(size);
        const uint32_t tail = __atomic_load_n(&tail_, __ATOMIC_ACQUIRE);
        uint32_t at = head_;
        if (!has_room(at, tail, need)) {
            if (at < tail || at >= kGrains || need >= tail) return nullptr;
            write(at, Header{0, kSeam, 0, 0, 0});
            at = 0;
        }
        reserved_ = at;
        return place(at) + kGrain;
    }

    // Gives the reader what was reserved last: its first `size` bytes, no more than were reserved.
    void commit(uint8_t kind, uint8_t flags, uint64_t time_us, size_t size) {
        const uint32_t next = reserved_ + space_for(size);
        write(reserved_, Header{time_us, static_cast<uint32_t>(size), kind, flags, 0});
        __atomic_store_n(&head_, next == kGrains ? 0 : next, __ATOMIC_RELEASE);
    }

    // The oldest record; false for none.
    bool front(Record* record) {
        const uint32_t head = __atomic_load_n(&head_, __ATOMIC_ACQUIRE);
        if (head == tail_) return false;
        Header header = read(tail_);
        if (header.size == kSeam) {
            __atomic_store_n(&tail_, 0u, __ATOMIC_RELEASE);
            header = read(0);
        }
        *record = Record{header.time_us, header.size, header.kind, header.flags, place(tail_) + kGrain};
        return true;
    }

    // Forgets the record that front() gave.
    void pop() {
        const uint32_t next = tail_ + space_for(read(tail_).size);
        __atomic_store_n(&tail_, next == kGrains ? 0 : next, __ATOMIC_RELEASE);
    }

  private:
    struct Header {
        uint64_t time_us;
        uint32_t size;
        uint8_t kind;
        uint8_t flags;
        uint16_t unused;
    };
    static constexpr uint32_t kGrain = 16;  // bytes; places and lengths are counted in grains
    static constexpr uint32_t kGrains = kCapacity / kGrain;
    static constexpr uint32_t kSeam = UINT32_MAX;  // the size of a header that says: go on at the ring's begin
    static_assert(sizeof(Header) == kGrain, "a header takes one grain, so it always fits before the seam");
    static_assert(kCapacity % kGrain == 0, "the ring holds whole grains");

    static uint32_t space_for(size_t size) { return 1 + (static_cast<uint32_t>(size) + kGrain - 1) / kGrain; }
    // Room at `at` before the seam or the tail; a full ring must not look empty.
    static bool has_room(uint32_t at, uint32_t tail, uint32_t need) {
        if (at < tail) return need < tail - at;
        return need < kGrains - at || (need == kGrains - at && tail != 0);
    }
    void write(uint32_t at, const Header& header) { memcpy(place(at), &header, sizeof header); }
    Header read(uint32_t at) const {
        Header header;
        memcpy(&header, bytes_ + at * kGrain, sizeof header);
        return header;
    }
    uint8_t* place(uint32_t at) { return bytes_ + at * kGrain; }

    alignas(8) uint8_t bytes_[kCapacity];
    uint32_t head_ = 0;      // stored by the writer only
    uint32_t reserved_ = 0;  // the writer's own
    uint32_t tail_ = 0;      // stored by the reader only
};

}  // namespace gemelo
