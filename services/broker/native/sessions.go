package main

import (
	"bytes"
	"math"
	"slices"
	"sync"
	"sync/atomic"

	mqtt "github.com/mochi-mqtt/server/v2"
	"github.com/mochi-mqtt/server/v2/packets"
)

// ownID stands for the packet id of a QoS 1 message while it is handled: the library keeps what it has received and what
// it has sent under the same ids, so that the one would take the other away.
const ownID = math.MaxUint16

// sessions lets one connection have a client id: a newer one ends the older one, and begins when that is over.
//
// The library alone lets both run side by side for a moment. In that moment the end of the older one may take the
// newer one out of the table of clients, which then receives nothing more; or the older one's will may follow what the
// newer one has published.
type sessions struct {
	mqtt.HookBase
	server *mqtt.Server
	count  atomic.Int64 // of messages that await an acknowledgement, over all clients
	lock   sync.Mutex
	claims map[string]*connection // by client id: whose session is being established
	ids    map[*connection]string
}

func newSessions(server *mqtt.Server) *sessions {
	return &sessions{server: server, claims: map[string]*connection{}, ids: map[*connection]string{}}
}

func (s *sessions) ID() string { return "sessions" }

func (s *sessions) Provides(event byte) bool {
	return bytes.IndexByte([]byte{
		mqtt.OnConnect, mqtt.OnSessionEstablish, mqtt.OnSessionEstablished,
		mqtt.OnQosPublish, mqtt.OnPacketRead, mqtt.OnPacketEncode,
	}, event) >= 0
}

// OnConnect takes away what the library does not keep to: its count of what a client may still be sent loses one with
// every message that had to wait, and at 0 nothing is sent any more; an alias may be used whose message was dropped.
func (s *sessions) OnConnect(client *mqtt.Client, _ packets.Packet) error {
	client.Properties.Props.ReceiveMaximum = 0
	client.Properties.Props.TopicAliasMaximum = 0
	client.State.Inflight.ResetSendQuota(0)
	return nil
}

// OnPacketRead is followed by the acknowledgement, in the same thread, before the next packet is read.
func (s *sessions) OnPacketRead(client *mqtt.Client, packet packets.Packet) (packets.Packet, error) {
	c, is := client.Net.Conn.(*connection)
	if is && packet.FixedHeader.Type == packets.Publish && packet.FixedHeader.Qos == 1 && packet.PacketID != 0 {
		c.asked, packet.PacketID = packet.PacketID, ownID
	}
	return packet, nil
}

// OnPacketEncode gives the acknowledgement its packet id back.
func (s *sessions) OnPacketEncode(client *mqtt.Client, packet packets.Packet) packets.Packet {
	c, is := client.Net.Conn.(*connection)
	if is && packet.FixedHeader.Type == packets.Puback && packet.PacketID == ownID {
		packet.PacketID = c.asked
	}
	return packet
}

// OnSessionEstablish is called after the password has been accepted, before the library looks for an older session.
func (s *sessions) OnSessionEstablish(client *mqtt.Client, _ packets.Packet) {
	c, is := client.Net.Conn.(*connection)
	if !is {
		return
	}
	s.claim(client.ID, c)
	older, is := s.server.Clients.Get(client.ID)
	if !is {
		return
	}
	if of, is := older.Net.Conn.(*connection); is {
		end(older, of)
	}
	renumber(older.State.Inflight)
}

// OnSessionEstablished is called when the client is in the library's table and has its CONNACK.
func (s *sessions) OnSessionEstablished(client *mqtt.Client, _ packets.Packet) {
	if c, is := client.Net.Conn.(*connection); is {
		s.release(c)
	}
}

// OnQosPublish numbers the messages: the library sorts them by their second, and mixes those of one.
func (s *sessions) OnQosPublish(client *mqtt.Client, packet packets.Packet, _ int64, _ int) {
	if packet.FixedHeader.Type == packets.Publish {
		packet.Created = s.count.Add(1)
		client.State.Inflight.Set(packet)
	}
}

// claim waits until no other connection establishes a session of that id.
func (s *sessions) claim(id string, c *connection) {
	for {
		s.lock.Lock()
		holder, isTaken := s.claims[id]
		if !isTaken {
			s.claims[id], s.ids[c] = c, id
			s.lock.Unlock()
			return
		}
		s.lock.Unlock()
		<-holder.settled
	}
}

// release ends a connection's claim, if it has one.
func (s *sessions) release(c *connection) {
	s.lock.Lock()
	if id, has := s.ids[c]; has {
		delete(s.claims, id)
		delete(s.ids, c)
	}
	s.lock.Unlock()
	c.settle()
}

// end closes the connection of a client, and waits until its will is published and the library has forgotten it.
//
// MQTT 5 has a packet that says why; MQTT 3.1.1 knows none from a broker. The connection is closed below the library,
// which then publishes the will.
func end(client *mqtt.Client, c *connection) {
	c.hurry()
	if client.Properties.ProtocolVersion == 5 {
		_ = client.WritePacket(packets.Packet{
			FixedHeader: packets.FixedHeader{Type: packets.Disconnect},
			ReasonCode:  packets.ErrSessionTakenOver.Code,
		})
	}
	_ = c.raw.Close()
	<-c.done
}

// renumber gives the waiting messages of a session the numbers 1, 2, 3: the library compares their last 16 bits.
func renumber(waiting *mqtt.Inflight) {
	all := waiting.GetAll(false)
	slices.SortStableFunc(all, func(a, b packets.Packet) int { return int(a.Created - b.Created) })
	for i, packet := range all {
		packet.Created = int64(i + 1)
		waiting.Set(packet)
	}
}
