// The words of PROTOCOL.md: frame types, codes, modes, faults, commands.
#pragma once

#include <stdint.h>

namespace gemelo {

constexpr uint8_t kMagic = 0x67;
constexpr uint8_t kProtocolVersion = 1;  // standard: PROTOCOL.md, of every frame
constexpr uint8_t kNewestProtocol = 2;   // standard: the same, with REPLACE

enum class FrameType : uint8_t {
    Traj = 1,
    Ack,
    Cmd,
    CmdAck,
    Heartbeat,
    Sync,
    SyncReply,
    State,
    // JSON in a frame: only on a serial line, for what has a topic of its own on MQTT.
    Config,
    ConfigAck,
    Sensors,
    Status,
    Event,
    Provision,
    ProvisionAck,
    Inject,  // virtual devices only
    Shaft,   // virtual devices only
    Update,
    UpdateAck,  // JSON, as the others of a serial line
};

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
    NotArmed,
    EstopPressed,
    NoHoming,
    BadArgument,
    AccelerationLimit,
    Late,       // the knot that a replacement goes on from has been passed
    OtherKnot,  // there is none, or another one: a replacement before was lost or refused
    NoStop,     // the arm could not stop on the new path
};

enum class Mode : uint8_t { Boot, Unreferenced, Homing, Idle, Run, Hold, Fault, EStop };

enum class FaultCode : uint8_t {
    None,
    TickOverrun,
    Internal,
    LimitSwitch,
    HomingTimeout,
    SwitchNotFound,
    SwitchStuck,
    EmergencyStop,
};

enum class Command : uint8_t {
    Hold = 1,
    Resume,
    Stop,
    Reset,
    Reference,
    Arm,
    Disarm,
    Home,
    Output,
    Speed,
    Status,
    Servo,
};

constexpr uint16_t kFlagFirst = 1;
constexpr uint16_t kFlagLast = 2;
constexpr uint16_t kFlagReplace = 4;
constexpr uint8_t kNoJoint = 255;
constexpr uint32_t kMinDtUs = 1000;    // standard: a slot
constexpr uint32_t kMaxDtUs = 250000;  // chosen

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
