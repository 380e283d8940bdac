<?xml version="1.0" encoding="utf-8"?>
<ISO15745ProfileContainer xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
  <ProfileBody xsi:type="ProfileBody_Device_CANopen" fileName="f.xdc" fileVersion="V2.5" fileCreationDate="2026-11-27" fileCreationTime="14:05:00">
    <DeviceIdentity>
      <vendorName>Vendor &amp; Söhne</vendorName><vendorID>0x123</vendorID>
      <productName>P</productName><productID>7</productID>
    </DeviceIdentity>
    <CANopenObjectList mandatoryObjects="4">
      <CANopenObject index="1000" name="Device type" objectType="7" dataType="0007" accessType="ro" defaultValue="0" PDOmapping="no"/>
      <CANopenObject index="1001" name="Error register" objectType="7" dataType="0005" accessType="ro" defaultValue="0x1FF" PDOmapping="TPDO"/>
      <CANopenObject index="1017" name="Heartbeat" objectType="7" dataType="0006" accessType="rw" defaultValue="0" PDOmapping="no" actualValue="100"/>
      <CANopenObject index="1018" name="Identity" objectType="9" subNumber="3">
        <CANopenSubObject subIndex="00" name="Highest" objectType="7" dataType="0005" accessType="const" defaultValue="1" PDOmapping="no"/>
        <CANopenSubObject subIndex="01" name="Vendor" objectType="7" dataType="0007" accessType="ro" defaultValue="0x123" PDOmapping="no"/>
      </CANopenObject>
    </CANopenObjectList>
    <baudRate><supportedBaudRate value="125 Kbps"/><supportedBaudRate value="auto-baudRate"/></baudRate>
    <CANopenGeneralFeatures granularity="8" nrOfTxPDO="0" bootUpSlave="true"/>
    <deviceCommissioning nodeID="5" nodeName="n" actualBaudRate="125 Kbps"/>
  </ProfileBody>
</ISO15745ProfileContainer>
