// The words of PROTOCOL.md: frame types, codes, modes, faults, commands.
#pragma once

#include <stdint.h>

namespace gemelo {

constexpr uint8_t kMagic = 0x67;
constexpr uint8_t kProtocolVersion = 1;

enum class FrameType : uint8_t { Traj = 1, Ack, Cmd, CmdAck, Heartbeat, Sync, SyncReply, State };

enum class Code : uint8_t {
    Ok,
    Duplicate,
    Gap,
    NoSpace,
    BadDt,
    PositionLimit,
    VelocityLimit,
    StartMismatch,
    WrongBoot,
    Expired,
    Retained,
    BadJoints,
    NotReady,
    WrongStream,
    NotAtRest,
    UnknownCommand,
    BadCount,
};

// 2 (Homing) and 7 (EStop) are kept for devices that can do them.
enum class Mode : uint8_t { Boot = 0, Unreferenced = 1, Idle = 3, Run = 4, Hold = 5, Fault = 6 };

enum class FaultCode : uint8_t { None, TickOverrun, Internal };

enum class Command : uint8_t { Hold = 1, Resume, Stop, Reset, Reference };

constexpr uint16_t kFlagFirst = 1;
constexpr uint16_t kFlagLast = 2;
constexpr uint8_t kNoJoint = 255;
constexpr uint32_t kMinDtUs = 1000;
constexpr uint32_t kMaxDtUs = 250000;

// Why a chunk was refused: which joint of which knot, its value and the limit it met.
struct Verdict {
    Code code = Code::Ok;
    uint8_t joint = kNoJoint;
    uint16_t knot = 0;
    int32_t value = 0;
    int32_t limit = 0;

    bool is_ok() const { return code == Code::Ok; }
};

}  // namespace gemelo
