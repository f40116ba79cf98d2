// The device: frames in, a step stream and reports out.
//
// receive() and slot() belong to one task; only Stepper::tick() is an interrupt. slot() runs once per slot, after its
// first tick, and prepares the increments of the slot after.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "chunk.h"
#include "command_log.h"
#include "config.h"
#include "homing.h"
#include "path.h"
#include "ramp.h"
#include "report.h"
#include "servo.h"
#include "stepper.h"
#include "stream_log.h"
#include "update.h"

namespace gemelo {

// The texts are kept, not copied.
struct Identity {
    uint32_t boot_id;
    const char* reset_cause;
    bool is_virtual = false;
    const char* device = "";  // what it is called until a configuration says it
    const char* slot = "";    // that its firmware runs from
};

// A frame as it came off the wire.
struct Arrival {
    const uint8_t* bytes;
    size_t size;
    bool is_retained;
    uint64_t received_us;
};

class Machine {
  public:
    // The device is in Boot until start(). `config` is kept; it has no fault, or no joints if there is none yet.
    void begin(DeviceConfig& config, const Identity& identity, const Sink& sink);
    // The joints stand at these whole steps; `referenced` is believed if the device arms itself at boot.
    void start(uint64_t now_us, const int32_t* steps, bool referenced);
    // Begins anew with what `config` says now: unreferenced, disarmed, the same boot; says so. Only if takes_config().
    void restart();

    void receive(const Arrival& arrival, uint64_t now_us);
    // The same where the frame has been opened already.
    void receive(const Frame& frame, const Arrival& arrival, uint64_t now_us);
    // The text of a configuration.
    void receive_config(const Arrival& arrival, uint64_t now_us);
    bool takes_config() const;
    // True once in every 4 s without a heartbeat: what is sent may not reach the device, though it is connected to its
    // broker, and the platform is to subscribe anew.
    bool subscribes_anew(uint64_t now_us);
    // Text mode: every joint to its target, Q24.8 steps, within its own limits. Counts as a heartbeat.
    Code follow(const int32_t* target_q8, uint64_t now_us);
    // At any time, from the slot's task: mV, or us of echo.
    void set_sensor(uint8_t index, int32_t raw);
    void slot(uint64_t slot_start_us);
    void report_status() const;
    // The platform is about to stop: slow down along the path.
    void halt();

    // For what stands around the machine: what it could not read, and what it says itself.
    void count_bad_frame() { ++bad_frames_; }
    void report_text_lost(uint32_t lines);
    void event(const char* name, const char* detail = "");
    void say(Output output, const uint8_t* bytes, size_t size) const { reporter_.say(output, bytes, size); }

    const DeviceConfig& config() const { return *config_; }
    // Changes when a configuration was taken: the platform sets its pins up anew.
    uint32_t config_crc32() const { return config_->crc32; }
    // Logical: the platform applies `is_inverted` and drives its pins after each slot.
    bool is_enabled() const { return is_armed_; }
    uint16_t outputs() const { return outputs_; }
    const Servo& servo() const { return servo_; }
    // Nothing moves and no pulse is due: a platform may write its flash.
    bool keeps_still() const { return !is_moving(); }

    Stepper& stepper() { return stepper_; }
    const Stepper& stepper() const { return stepper_; }
    Mode mode() const { return mode_; }
    bool is_referenced() const { return rules_.joints != 0 && referenced_ == all_joints(); }
    bool is_moving() const { return mode_ == Mode::Run || mode_ == Mode::Homing || !is_at_rest(); }
    // As of the end of the last whole slot.
    const Point& present() const { return points_[stepper_.latched_number() % kPoints]; }
    // The largest |path - executed| at any slot end so far, Q8 steps rounded up.
    uint32_t max_slot_error_q8() const { return static_cast<uint32_t>((max_error_q20_ + 4095) >> 12); }

  private:
    void receive_chunk(const Frame& frame, const Arrival& arrival);
    Verdict judge(const Chunk& chunk, const Arrival& arrival) const;
    Verdict judge_place(const Chunk& chunk) const;
    Verdict judge_replacement(const Chunk& chunk) const;
    uint32_t ceiling_of(const Chunk& chunk) const;
    bool is_duplicate(const Chunk& chunk) const;
    void take_chunk(const Chunk& chunk);
    void open_stream(const Chunk& chunk);
    void acknowledge(const Chunk& chunk, const Verdict& verdict);

    void receive_command(const Frame& frame, const Arrival& arrival);
    Code judge_command(const Frame& frame, const Arrival& arrival) const;
    Code carry_out(const Frame& frame);
    Code carry_out_hold();
    Code stop();
    Code resume();
    Code switch_output(uint8_t index, uint16_t level);
    Code change_speed(uint16_t permil);
    Code turn_servo(uint8_t index, uint16_t pulse_us);
    void watch_servo();
    Code arm();
    Code disarm();
    Code reset();
    Code reference(const Frame& frame, uint16_t joints);
    void receive_heartbeat(const Frame& frame, const Arrival& arrival);
    void receive_sync(const Frame& frame, const Arrival& arrival);
    void receive_update(const Frame& frame, const Arrival& arrival);

    // Motion that is no stream.
    Code home(uint16_t joints);
    void start_ramps();
    void bound_ramps();
    bool ramps_are_there() const;
    void watch_homing();
    void finish_homing();
    void note_homed();
    void watch_switches();
    void note_passed(uint32_t risen);
    void stop_homing(const char* cause);
    void watch_following();
    void advance_ramps(Point* point);

    void watch_ticks(uint64_t slot_start_us);
    void finish_slot();
    void finish_stream_slot(const Point& point);
    void measure(const Point& point);
    void announce_start();
    void end_motion(const char* event);
    void watch_supply(const Point& point);
    void plan_slot();
    bool offer(const Point& before, const Point& next);
    void hold(const char* cause);
    void place(const int64_t* position_q20);
    void shift(uint8_t joint, int32_t steps);

    // What keeps people and machines whole.
    void watch_trips();
    void watch_heartbeat();
    void guard_switches();
    uint8_t find_limit_ahead(const Point& before, const Point& next) const;
    void press_estop();
    void enter_estop();
    void fail(FaultCode fault, const char* detail, uint8_t joint = kNoJoint, bool was_moving = false);
    void stop_dead(bool was_moving);
    void set_armed(bool armed, const char* cause);
    bool takes_motion() const;  // armed, for long enough

    void begin_inputs();
    void begin_outputs();
    void report_due();
    void report_state(const Point& point);
    void report_sensors();
    bool is_at_rest() const { return is_still_ && stepper_.is_quiet(); }
    uint16_t all_joints() const { return static_cast<uint16_t>((1u << rules_.joints) - 1); }
    uint32_t speed_q30() const;
    uint16_t buffered_ms() const;

    static constexpr size_t kCommandSize = 24;  // standard: PROTOCOL.md
    static constexpr uint8_t kPoints = 4;       // follows from the slots: before, finished, running, prepared

    DeviceConfig* config_ = nullptr;
    Identity identity_{};
    Reporter reporter_;
    KnotRules rules_{};
    Path path_;
    Ramp ramp_[kMaxJoints];
    Homing homing_;
    Stepper stepper_;
    StreamLog streams_;
    CommandLog commands_;
    UpdateReceiver update_;
    Servo servo_;

    Point points_[kPoints];
    uint32_t prepared_number_ = 0;
    bool is_still_ = true;  // the prepared slot has no increments

    Mode mode_ = Mode::Boot;
    FaultCode fault_ = FaultCode::None;
    uint8_t fault_joint_ = kNoJoint;
    uint16_t referenced_ = 0;      // bit j: the place of joint j is known
    uint16_t was_referenced_ = 0;  // when homing began
    uint32_t limits_ = 0;          // bit i: input i is a limit switch
    uint32_t homes_ = 0;           // the same: a switch that a joint homes with
    uint32_t seen_ = 0;            // the inputs that were active at the end of the slot before
    uint16_t outputs_ = 0;
    uint16_t speed_permil_ = 1000;
    bool is_armed_ = false;
    bool is_following_ = false;  // Run and Hold are text mode's
    bool is_stopping_ = false;
    bool is_dry_ = false;
    bool has_stood_ = false;  // no tick came before this slot: what the slots before it say of speed is over
    bool awaits_first_pulse_ = false;
    bool is_opening_ = false;       // no slot of the stream has been made yet
    int32_t start_q8_[kMaxJoints];  // where the stream begins

    uint64_t now_us_ = 0;
    uint64_t slot_us_ = 0;  // the start of the last slot that was looked after
    uint64_t armed_us_ = 0;
    uint64_t alive_us_ = 0;       // of the last heartbeat, or of the start or resumption if that was later
    uint64_t beat_us_ = 0;        // of the last heartbeat that counted
    uint64_t subscribed_us_ = 0;  // when the platform was last asked to subscribe anew
    uint64_t servo_us_ = 0;       // of the last command to the servo
    uint64_t status_due_us_ = 0;
    uint32_t session_ = 0;
    uint32_t counter_ = 0;
    bool has_session_ = false;

    uint32_t slots_to_state_ = 0;
    uint32_t slots_to_sensors_ = 0;
    uint32_t underruns_ = 0;
    uint32_t refused_ = 0;
    uint32_t bad_frames_ = 0;
    int64_t max_error_q20_ = 0;
    uint16_t heard_ = 0;  // sensors that have a reading
    int32_t sensor_milli_[kMaxSensors];
    uint8_t sensor_tellings_[kMaxSensors];  // left for the reading
};

}  // namespace gemelo
